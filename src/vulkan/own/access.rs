//! The rule for mapped memory: the host and a pending command buffer never use the same buffer at the same time.

use super::super::result::misuse_of;
use crate::Result;
use std::marker::PhantomData;
use std::ops::{Deref, DerefMut};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicI64, Ordering};

/// Who uses a mapped buffer now, counted as `RefCell` counts borrows.
///
/// Every slice of the mapping is one use by the host, every pending command buffer that names the buffer one use by the
/// device. If one side uses the buffer, the other gets an error, so that no byte changes behind a reference. A slice or
/// a command buffer that is leaked keeps its use for ever, which is safe.
pub(in crate::vulkan) struct Access {
    name: String,
    /// The number of uses: positive if by the host, negative if by the device.
    uses: AtomicI64,
}

impl Access {
    pub(super) fn new(name: &str) -> Self {
        Self { name: name.to_string(), uses: AtomicI64::new(0) }
    }

    /// Begins a use by the host, which ends when the returned value is dropped.
    pub(super) fn by_host(&self) -> Result<HostUse<'_>> {
        let one_more = |uses: i64| (uses >= 0).then_some(uses + 1);
        // Acquire: what was done before the device's last use ended is visible to the host.
        match self.uses.fetch_update(Ordering::Acquire, Ordering::Relaxed, one_more) {
            Ok(_) => Ok(HostUse(self)),
            Err(_) => {
                let what = format!("buffer `{}` is in use by a pending command buffer: settle that first", self.name);
                Err(misuse_of("buffer access", &what))
            }
        }
    }

    /// Begins a use by the device, which ends with [`end_by_device`](Self::end_by_device).
    pub(in crate::vulkan) fn by_device(&self) -> Result<()> {
        let one_more = |uses: i64| (uses <= 0).then_some(uses - 1);
        match self.uses.fetch_update(Ordering::Acquire, Ordering::Relaxed, one_more) {
            Ok(_) => Ok(()),
            Err(_) => {
                let what = format!("the host holds a slice of buffer `{}`: drop it before submitting", self.name);
                Err(misuse_of("vkQueueSubmit", &what))
            }
        }
    }

    /// Ends a use that [`by_device`](Self::by_device) began.
    pub(in crate::vulkan) fn end_by_device(&self) {
        self.uses.fetch_add(1, Ordering::Release);
    }
}

/// One use of a mapped buffer by the host.
pub(super) struct HostUse<'a>(&'a Access);

impl Drop for HostUse<'_> {
    fn drop(&mut self) {
        self.0.uses.fetch_sub(1, Ordering::Release);
    }
}

/// Bytes of a mapped buffer to read. While it lives, command buffers that name the buffer cannot be submitted.
pub struct Mapped<'a> {
    // A pointer, as in `std::cell::Ref`: a reference would have to be valid until the end of the drop, which is after the
    // use has ended.
    bytes: NonNull<[u8]>,
    _use: HostUse<'a>,
}

/// Bytes of a mapped buffer to read and write, as [`Mapped`].
pub struct MappedMut<'a> {
    bytes: NonNull<[u8]>,
    _use: HostUse<'a>,
    _exclusive: PhantomData<&'a mut [u8]>,
}

impl<'a> Mapped<'a> {
    /// # Safety
    /// The bytes are mapped as long as `'a`, the host only writes them through a `&mut` of their buffer, which `'a` excludes,
    /// and `used` is a use of that buffer.
    pub(super) unsafe fn new(bytes: NonNull<[u8]>, used: HostUse<'a>) -> Self {
        Self { bytes, _use: used }
    }
}

impl<'a> MappedMut<'a> {
    /// # Safety
    /// The bytes are mapped as long as `'a`, for which the caller holds a `&mut` of their buffer, and `used` is a use of that
    /// buffer.
    pub(super) unsafe fn new(bytes: NonNull<[u8]>, used: HostUse<'a>) -> Self {
        Self { bytes, _use: used, _exclusive: PhantomData }
    }
}

impl Deref for Mapped<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        // SAFETY: the promise of `new`: mapped, and neither the host nor the device writes while the use lasts.
        unsafe { self.bytes.as_ref() }
    }
}

impl Deref for MappedMut<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        // SAFETY: the promise of `new`: mapped, and nobody else writes while the use lasts.
        unsafe { self.bytes.as_ref() }
    }
}

impl DerefMut for MappedMut<'_> {
    fn deref_mut(&mut self) -> &mut [u8] {
        // SAFETY: as above, and `&mut self` makes it the only reference.
        unsafe { self.bytes.as_mut() }
    }
}

impl std::fmt::Debug for Mapped<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Mapped({} bytes)", self.len())
    }
}

impl std::fmt::Debug for MappedMut<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "MappedMut({} bytes)", self.len())
    }
}
