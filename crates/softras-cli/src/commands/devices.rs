//! `softras devices`: lists the Vulkan devices and their limits.

use super::{Failure, say};
use clap::Args;
use serde_json::{Value, json};
use softras::{DeviceInfo, Limits, Renderer};

/// List the Vulkan devices and their limits
#[derive(Args, Debug)]
#[command(after_help = "\
Every --device option takes an index or a part of a name from this list. Without the option the
environment variable SOFTRAS_DEVICE is used, and without that the best device. SOFTRAS_DRIVER names
a driver's file to open in place of the Vulkan loader and the installed drivers.

Examples:
  softras devices
  softras render bunny.obj -o bunny.png --device 1
  SOFTRAS_DEVICE=llvmpipe softras render bunny.obj -o bunny.png
  SOFTRAS_DRIVER=/opt/libvulkan_lvp.so softras devices")]
pub struct DevicesArgs {
    /// Print one JSON array
    #[arg(long)]
    pub json: bool,
}

pub fn run(args: &DevicesArgs) -> Result<(), Failure> {
    let devices = Renderer::devices()?;
    if args.json {
        return say(&Value::Array(devices.iter().map(as_json).collect()).to_string());
    }
    devices.iter().try_for_each(|device| say(&as_text(device)))
}

fn version((major, minor, patch): (u32, u32, u32)) -> String {
    format!("{major}.{minor}.{patch}")
}

fn as_text(device: &DeviceInfo) -> String {
    let Limits { device_heap, max_storage_buffer_range, max_texel_buffer_elements, subgroup_size, .. } = device.limits;
    let usable = match &device.suitable {
        Ok(()) => "usable".to_string(),
        Err(why) => format!("NOT usable: {why}"),
    };
    let file = device.file.as_ref().map_or(String::new(), |file| format!(" from {}", file.display()));
    let mib = |bytes: u64| bytes >> 20;
    format!(
        "{}: {} ({}, Vulkan {}, {} {}{file})\n   {usable}; memory {} MiB, storage buffers to {} MiB, texel buffers to {} Mi \
         elements, subgroups of {}",
        device.index,
        device.name,
        device.kind,
        version(device.api_version),
        device.driver,
        device.driver_version,
        mib(device_heap),
        mib(max_storage_buffer_range),
        mib(max_texel_buffer_elements),
        subgroup_size,
    )
}

fn as_json(device: &DeviceInfo) -> Value {
    let limits = &device.limits;
    json!({
        "index": device.index,
        "name": device.name,
        "kind": device.kind.to_string(),
        "driver": device.driver,
        "driver_version": device.driver_version,
        "driver_file": device.file,
        "api_version": version(device.api_version),
        "usable": device.suitable.is_ok(),
        "why_not": device.suitable.as_ref().err(),
        "memory_bytes": limits.device_heap,
        "max_storage_buffer_range": limits.max_storage_buffer_range,
        "max_texel_buffer_elements": limits.max_texel_buffer_elements,
        "max_memory_allocation_size": limits.max_memory_allocation_size,
        "max_workgroup_invocations": limits.max_workgroup_invocations,
        "max_shared_memory": limits.max_shared_memory,
        "timestamp_period_nanoseconds": limits.timestamp_period,
        "subgroup_size": limits.subgroup_size,
    })
}
