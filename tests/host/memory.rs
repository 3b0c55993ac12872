//! Host memory as a foreign allocator gives it: counted, and refused after a number of calls.
#![allow(dead_code)]

use ash::vk;
use std::ffi::c_void;
use std::sync::atomic::{AtomicI64, Ordering};

/// The number of live allocations, and how many more succeed.
pub struct Memory {
    live: AtomicI64,
    left: AtomicI64,
}

impl Memory {
    pub fn new() -> Self {
        Self { live: AtomicI64::new(0), left: AtomicI64::new(i64::MAX) }
    }

    /// Allocations that were not freed: with a driver that keeps its objects in them, the live objects.
    pub fn live(&self) -> i64 {
        self.live.load(Ordering::Relaxed)
    }

    /// Lets this many more allocations succeed.
    pub fn allow(&self, count: i64) {
        self.left.store(count, Ordering::Relaxed);
    }

    /// For Vulkan to call; self must outlive what is made with them.
    pub fn callbacks(&self) -> vk::AllocationCallbacks<'static> {
        vk::AllocationCallbacks {
            p_user_data: std::ptr::from_ref(self).cast_mut().cast(),
            pfn_allocation: Some(allocate),
            pfn_reallocation: Some(reallocate),
            pfn_free: Some(free),
            ..Default::default()
        }
    }
}

/// The size and the alignment go before each block, so that it can be freed and moved.
const HEADER: usize = 64;

fn layout(size: usize, alignment: usize) -> std::alloc::Layout {
    std::alloc::Layout::from_size_align(size + HEADER, alignment.max(HEADER)).unwrap()
}

unsafe extern "system" fn allocate(
    user: *mut c_void,
    size: usize,
    alignment: usize,
    _: vk::SystemAllocationScope,
) -> *mut c_void {
    let memory = unsafe { &*user.cast::<Memory>() };
    if size == 0 || memory.left.fetch_sub(1, Ordering::Relaxed) <= 0 {
        return std::ptr::null_mut();
    }
    memory.live.fetch_add(1, Ordering::Relaxed);
    unsafe {
        let block = std::alloc::alloc(layout(size, alignment));
        block.cast::<[usize; 2]>().write([size, alignment]);
        block.add(HEADER).cast()
    }
}

unsafe extern "system" fn free(user: *mut c_void, at: *mut c_void) {
    if at.is_null() {
        return;
    }
    unsafe {
        (*user.cast::<Memory>()).live.fetch_sub(1, Ordering::Relaxed);
        let block = at.cast::<u8>().sub(HEADER);
        let [size, alignment] = block.cast::<[usize; 2]>().read();
        std::alloc::dealloc(block, layout(size, alignment));
    }
}

unsafe extern "system" fn reallocate(
    user: *mut c_void,
    at: *mut c_void,
    size: usize,
    alignment: usize,
    scope: vk::SystemAllocationScope,
) -> *mut c_void {
    unsafe {
        let new = if size == 0 { std::ptr::null_mut() } else { allocate(user, size, alignment, scope) };
        if !at.is_null() && (size == 0 || !new.is_null()) {
            let [old, _] = at.cast::<u8>().sub(HEADER).cast::<[usize; 2]>().read();
            if !new.is_null() {
                std::ptr::copy_nonoverlapping(at.cast::<u8>(), new.cast(), old.min(size));
            }
            free(user, at);
        }
        new
    }
}
