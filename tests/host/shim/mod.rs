//! A loader between softras and the driver: it counts every object that is made and destroyed, makes the nth call that
//! makes or allocates something fail, and shows the physical device otherwise than it is ([`adapter`]). Its state is the
//! process's: one test at a time ([`lock`]).

// Not every test needs every part.
#![allow(dead_code)]

pub mod adapter;

use adapter::{
    vkCmdPipelineBarrier, vkCreateDevice, vkGetDeviceQueue, vkGetPhysicalDeviceMemoryProperties,
    vkGetPhysicalDeviceProperties2, vkGetPhysicalDeviceQueueFamilyProperties,
};
use ash::vk;
use softras::Loader;
use std::collections::BTreeMap;
use std::ffi::{CStr, c_char};
use std::sync::atomic::{AtomicI64, AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

/// How many objects of each kind were made, and how many destroyed.
static OBJECTS: Mutex<BTreeMap<&str, [i64; 2]>> = Mutex::new(BTreeMap::new());
/// Calls that make something and still succeed.
static LEFT: AtomicI64 = AtomicI64::new(i64::MAX);
/// vkAllocateMemory calls that still succeed.
static MEMORY_LEFT: AtomicI64 = AtomicI64::new(i64::MAX);
/// Submissions that still succeed; then the device is lost.
static SUBMITS_LEFT: AtomicI64 = AtomicI64::new(i64::MAX);

/// Gives the state to one test, reset.
pub fn lock() -> MutexGuard<'static, ()> {
    static LOCK: Mutex<()> = Mutex::new(());
    let guard = LOCK.lock().unwrap_or_else(PoisonError::into_inner);
    counts().clear();
    allow_all();
    adapter::show_all();
    guard
}

fn counts() -> MutexGuard<'static, BTreeMap<&'static str, [i64; 2]>> {
    OBJECTS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// How many objects of each kind were made, and how many destroyed.
pub fn objects() -> BTreeMap<&'static str, [i64; 2]> {
    counts().clone()
}

/// Objects that were made and not destroyed.
pub fn live() -> i64 {
    counts().values().map(|[made, destroyed]| made - destroyed).sum()
}

fn count(kind: &'static str, made: i64, destroyed: i64) {
    let mut counts = counts();
    let count = counts.entry(kind).or_default();
    *count = [count[0] + made, count[1] + destroyed];
}

/// Lets this many more calls that make something succeed, those for memory among them.
pub fn allow(count: i64) {
    LEFT.store(count, Relaxed);
}

/// Lets this many more allocations of device memory succeed.
pub fn allow_memory(count: i64) {
    MEMORY_LEFT.store(count, Relaxed);
}

/// Lets this many more submissions succeed.
pub fn allow_submits(count: i64) {
    SUBMITS_LEFT.store(count, Relaxed);
}

pub fn allow_all() {
    allow(i64::MAX);
    allow_memory(i64::MAX);
    allow_submits(i64::MAX);
}

/// vkGetInstanceProcAddr of this loader.
pub fn function() -> vk::PFN_vkGetInstanceProcAddr {
    get_instance_proc_addr
}

pub fn loader() -> Loader {
    unsafe { Loader::new(get_instance_proc_addr) }
}

fn entry() -> &'static ash::Entry {
    static ENTRY: OnceLock<ash::Entry> = OnceLock::new();
    ENTRY.get_or_init(|| unsafe { ash::Entry::load() }.expect("the Vulkan loader"))
}

/// One more of `left` is taken.
fn take(left: &AtomicI64) -> bool {
    left.fetch_update(Relaxed, Relaxed, |n| if n == i64::MAX { Some(n) } else { Some(n - 1) }).is_ok_and(|n| n > 0)
}

/// The error of a call that is to fail; `None` for one that is to succeed.
fn refused(name: &str) -> Option<vk::Result> {
    if name == "vkAllocateMemory" && !take(&MEMORY_LEFT) || !take(&LEFT) {
        return Some(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY);
    }
    None
}

/// The driver's functions that ours replace.
macro_rules! functions {
    ($($name:ident)*) => {
        #[allow(non_upper_case_globals)]
        mod real {
            $(pub static $name: super::AtomicUsize = super::AtomicUsize::new(0);)*
        }
    };
}

functions! {
    vkGetDeviceProcAddr vkQueueSubmit
    vkAllocateMemory vkCreateBuffer vkCreateBufferView vkCreateDescriptorSetLayout vkCreateDescriptorPool
    vkCreatePipelineLayout vkCreateShaderModule vkCreateComputePipelines vkCreatePipelineCache vkCreateCommandPool
    vkCreateFence vkCreateQueryPool vkAllocateDescriptorSets vkAllocateCommandBuffers
    vkFreeMemory vkDestroyBuffer vkDestroyBufferView vkDestroyDescriptorSetLayout vkDestroyDescriptorPool
    vkDestroyPipelineLayout vkDestroyShaderModule vkDestroyPipeline vkDestroyPipelineCache vkDestroyCommandPool
    vkDestroyFence vkDestroyQueryPool
    vkCreateDevice vkGetPhysicalDeviceQueueFamilyProperties vkGetPhysicalDeviceProperties2
    vkGetPhysicalDeviceMemoryProperties vkGetDeviceQueue vkCmdPipelineBarrier
}

/// Makes one object: counted, or refused.
macro_rules! makes {
    ($name:ident: $info:ident -> $object:ident) => {
        #[allow(non_snake_case)]
        unsafe extern "system" fn $name(
            device: vk::Device,
            info: *const vk::$info<'_>,
            callbacks: *const vk::AllocationCallbacks<'_>,
            object: *mut vk::$object,
        ) -> vk::Result {
            type Real = unsafe extern "system" fn(
                vk::Device,
                *const vk::$info<'_>,
                *const vk::AllocationCallbacks<'_>,
                *mut vk::$object,
            ) -> vk::Result;
            if let Some(result) = refused(stringify!($name)) {
                return result;
            }
            let real = unsafe { std::mem::transmute::<usize, Real>(real::$name.load(Relaxed)) };
            let result = unsafe { real(device, info, callbacks, object) };
            count(stringify!($object), i64::from(result == vk::Result::SUCCESS), 0);
            result
        }
    };
}

/// Destroys one object, unless it is null.
macro_rules! destroys {
    ($name:ident: $object:ident) => {
        #[allow(non_snake_case)]
        unsafe extern "system" fn $name(
            device: vk::Device,
            object: vk::$object,
            callbacks: *const vk::AllocationCallbacks<'_>,
        ) {
            type Real = unsafe extern "system" fn(vk::Device, vk::$object, *const vk::AllocationCallbacks<'_>);
            let real = unsafe { std::mem::transmute::<usize, Real>(real::$name.load(Relaxed)) };
            unsafe { real(device, object, callbacks) };
            count(stringify!($object), 0, i64::from(object != vk::$object::null()));
        }
    };
}

makes!(vkAllocateMemory: MemoryAllocateInfo -> DeviceMemory);
makes!(vkCreateBuffer: BufferCreateInfo -> Buffer);
makes!(vkCreateBufferView: BufferViewCreateInfo -> BufferView);
makes!(vkCreateDescriptorSetLayout: DescriptorSetLayoutCreateInfo -> DescriptorSetLayout);
makes!(vkCreateDescriptorPool: DescriptorPoolCreateInfo -> DescriptorPool);
makes!(vkCreatePipelineLayout: PipelineLayoutCreateInfo -> PipelineLayout);
makes!(vkCreateShaderModule: ShaderModuleCreateInfo -> ShaderModule);
makes!(vkCreatePipelineCache: PipelineCacheCreateInfo -> PipelineCache);
makes!(vkCreateFence: FenceCreateInfo -> Fence);
makes!(vkCreateQueryPool: QueryPoolCreateInfo -> QueryPool);
destroys!(vkFreeMemory: DeviceMemory);
destroys!(vkDestroyBuffer: Buffer);
destroys!(vkDestroyBufferView: BufferView);
destroys!(vkDestroyDescriptorSetLayout: DescriptorSetLayout);
destroys!(vkDestroyDescriptorPool: DescriptorPool);
destroys!(vkDestroyPipelineLayout: PipelineLayout);
destroys!(vkDestroyShaderModule: ShaderModule);
destroys!(vkDestroyPipeline: Pipeline);
destroys!(vkDestroyPipelineCache: PipelineCache);
destroys!(vkDestroyCommandPool: CommandPool);
destroys!(vkDestroyFence: Fence);
destroys!(vkDestroyQueryPool: QueryPool);

/// Makes the pool for the driver's number of the family.
#[allow(non_snake_case)]
unsafe extern "system" fn vkCreateCommandPool(
    device: vk::Device,
    info: *const vk::CommandPoolCreateInfo<'_>,
    callbacks: *const vk::AllocationCallbacks<'_>,
    pool: *mut vk::CommandPool,
) -> vk::Result {
    if let Some(result) = refused("vkCreateCommandPool") {
        return result;
    }
    let mut info = unsafe { *info };
    info.queue_family_index = adapter::real_family(info.queue_family_index);
    let real = real::vkCreateCommandPool.load(Relaxed);
    let real = unsafe { std::mem::transmute::<usize, vk::PFN_vkCreateCommandPool>(real) };
    let result = unsafe { real(device, &raw const info, callbacks, pool) };
    count("CommandPool", i64::from(result == vk::Result::SUCCESS), 0);
    result
}

#[allow(non_snake_case)]
unsafe extern "system" fn vkCreateComputePipelines(
    device: vk::Device,
    cache: vk::PipelineCache,
    count: u32,
    infos: *const vk::ComputePipelineCreateInfo<'_>,
    callbacks: *const vk::AllocationCallbacks<'_>,
    pipelines: *mut vk::Pipeline,
) -> vk::Result {
    if let Some(result) = refused("vkCreateComputePipelines") {
        for i in 0..count as usize {
            unsafe { *pipelines.add(i) = vk::Pipeline::null() };
        }
        return result;
    }
    let real = real::vkCreateComputePipelines.load(Relaxed);
    let real = unsafe { std::mem::transmute::<usize, vk::PFN_vkCreateComputePipelines>(real) };
    let result = unsafe { real(device, cache, count, infos, callbacks, pipelines) };
    self::count("Pipeline", if result == vk::Result::SUCCESS { i64::from(count) } else { 0 }, 0);
    result
}

/// Sets and command buffers go with their pools.
#[allow(non_snake_case)]
unsafe extern "system" fn vkAllocateDescriptorSets(
    device: vk::Device,
    info: *const vk::DescriptorSetAllocateInfo<'_>,
    sets: *mut vk::DescriptorSet,
) -> vk::Result {
    let real = real::vkAllocateDescriptorSets.load(Relaxed);
    let real = unsafe { std::mem::transmute::<usize, vk::PFN_vkAllocateDescriptorSets>(real) };
    refused("vkAllocateDescriptorSets").unwrap_or_else(|| unsafe { real(device, info, sets) })
}

#[allow(non_snake_case)]
unsafe extern "system" fn vkAllocateCommandBuffers(
    device: vk::Device,
    info: *const vk::CommandBufferAllocateInfo<'_>,
    buffers: *mut vk::CommandBuffer,
) -> vk::Result {
    let real = real::vkAllocateCommandBuffers.load(Relaxed);
    let real = unsafe { std::mem::transmute::<usize, vk::PFN_vkAllocateCommandBuffers>(real) };
    refused("vkAllocateCommandBuffers").unwrap_or_else(|| unsafe { real(device, info, buffers) })
}

#[allow(non_snake_case)]
unsafe extern "system" fn vkQueueSubmit(
    queue: vk::Queue,
    count: u32,
    submits: *const vk::SubmitInfo<'_>,
    fence: vk::Fence,
) -> vk::Result {
    if !take(&SUBMITS_LEFT) {
        return vk::Result::ERROR_DEVICE_LOST;
    }
    let real = unsafe { std::mem::transmute::<usize, vk::PFN_vkQueueSubmit>(real::vkQueueSubmit.load(Relaxed)) };
    unsafe { real(queue, count, submits, fence) }
}

/// The driver's function is kept, ours is given out.
macro_rules! stand_before {
    ($given:expr, $name:expr, [$($ours:ident)*]) => {
        match $name {
            $(stringify!($ours) => {
                real::$ours.store($given.map_or(0, |f| f as usize), Relaxed);
                // A function's address as that of another kind, which is what Vulkan's loaders return.
                unsafe { std::mem::transmute::<*const (), vk::PFN_vkVoidFunction>($ours as *const ()) }
            })*
            _ => $given,
        }
    };
}

#[allow(non_snake_case)]
unsafe extern "system" fn vkGetDeviceProcAddr(device: vk::Device, name: *const c_char) -> vk::PFN_vkVoidFunction {
    let real = real::vkGetDeviceProcAddr.load(Relaxed);
    let real = unsafe { std::mem::transmute::<usize, vk::PFN_vkGetDeviceProcAddr>(real) };
    let given = unsafe { real(device, name) };
    let name = unsafe { CStr::from_ptr(name) }.to_str().unwrap_or_default();
    stand_before!(given, name, [
        vkQueueSubmit vkAllocateMemory vkCreateBuffer vkCreateBufferView vkCreateDescriptorSetLayout
        vkCreateDescriptorPool vkCreatePipelineLayout vkCreateShaderModule vkCreateComputePipelines
        vkCreatePipelineCache vkCreateCommandPool vkCreateFence vkCreateQueryPool vkAllocateDescriptorSets
        vkAllocateCommandBuffers vkFreeMemory vkDestroyBuffer vkDestroyBufferView vkDestroyDescriptorSetLayout
        vkDestroyDescriptorPool vkDestroyPipelineLayout vkDestroyShaderModule vkDestroyPipeline
        vkDestroyPipelineCache vkDestroyCommandPool vkDestroyFence vkDestroyQueryPool vkGetDeviceQueue
        vkCmdPipelineBarrier
    ])
}

unsafe extern "system" fn get_instance_proc_addr(
    instance: vk::Instance,
    name: *const c_char,
) -> vk::PFN_vkVoidFunction {
    let given = unsafe { (entry().static_fn().get_instance_proc_addr)(instance, name) };
    let name = unsafe { CStr::from_ptr(name) }.to_str().unwrap_or_default();
    stand_before!(given, name, [
        vkGetDeviceProcAddr vkCreateDevice vkGetPhysicalDeviceQueueFamilyProperties vkGetPhysicalDeviceProperties2
        vkGetPhysicalDeviceMemoryProperties
    ])
}
