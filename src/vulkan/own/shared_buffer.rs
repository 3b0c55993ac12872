//! A device buffer that the host fills or reads: mapped where possible, else with a copy in host memory.

use super::super::buffer_desc::{BufferDesc, Location};
use super::super::buffer_part::BufferPart;
use super::super::recorder::Recorder;
use super::access::{Mapped, MappedMut};
use super::buffer::Buffer;
use super::context::Context;
use crate::Result;
use ash::vk;

/// A device buffer that the host writes before, or reads after, the work on it.
///
/// If the host can map the device's memory (software, integrated), it reads and writes the buffer directly, and
/// [`record_upload`](Self::record_upload) and [`record_download`](Self::record_download) record nothing. Otherwise they
/// copy between the buffer and its twin in host memory; the caller puts barriers around them.
#[derive(Debug)]
pub struct SharedBuffer {
    device: Buffer,
    twin: Option<Buffer>,
}

impl SharedBuffer {
    /// A buffer for the host to write. `desc.location` is ignored.
    pub fn for_upload(context: &Context, desc: &BufferDesc<'_>) -> Result<Self> {
        Self::new(context, desc, Location::Upload)
    }

    /// A buffer for the host to read. `desc.location` is ignored.
    pub fn for_download(context: &Context, desc: &BufferDesc<'_>) -> Result<Self> {
        Self::new(context, desc, Location::Readback)
    }

    fn new(context: &Context, desc: &BufferDesc<'_>, location: Location) -> Result<Self> {
        let device = Buffer::new(context, &BufferDesc { location: Location::DeviceMapped, ..*desc })?;
        if device.is_mapped() {
            return Ok(Self { device, twin: None });
        }
        let name = format!("{} (host)", desc.name);
        let usage = vk::BufferUsageFlags::empty();
        let twin = Buffer::new(context, &BufferDesc { name: &name, size: desc.size, usage, location, texels: None })?;
        Ok(Self { device, twin: Some(twin) })
    }

    /// The device's buffer as a whole.
    pub fn whole(&self) -> &BufferPart {
        self.device.whole()
    }

    /// The device's buffer.
    pub fn buffer(&self) -> &Buffer {
        &self.device
    }

    /// Whether there is no twin, so that nothing is ever copied.
    pub fn is_direct(&self) -> bool {
        self.twin.is_none()
    }

    /// Writes bytes at an offset, for the next upload.
    pub fn write(&mut self, offset: u64, bytes: &[u8]) -> Result<()> {
        self.twin.as_mut().unwrap_or(&mut self.device).write(offset, bytes)
    }

    /// Reads bytes at an offset, as of the last download.
    pub fn read(&self, offset: u64, bytes: &mut [u8]) -> Result<()> {
        self.twin.as_ref().unwrap_or(&self.device).read(offset, bytes)
    }

    /// Bytes from the start where they are, as of the last download. While they are held, no command buffer that uses this
    /// buffer can be submitted.
    pub fn bytes(&self, range: u64) -> Result<Mapped<'_>> {
        self.twin.as_ref().unwrap_or(&self.device).bytes(0, range)
    }

    /// Bytes from the start, to be filled where they are for the next upload.
    pub fn bytes_mut(&mut self, range: u64) -> Result<MappedMut<'_>> {
        self.twin.as_mut().unwrap_or(&mut self.device).bytes_mut(0, range)
    }

    /// Copies what the host wrote to the device, if it is not there already. A [`Recorder::barrier`] must follow
    /// before a kernel reads it.
    pub fn record_upload(&self, recorder: &mut Recorder<'_>) -> Result<()> {
        match &self.twin {
            Some(twin) => recorder.copy(twin.whole(), 0, self.whole(), 0, twin.size()),
            None => Ok(()),
        }
    }

    /// Copies what the device wrote to where the host reads it, if it is not there already. A [`Recorder::barrier`]
    /// must lie between the kernels and this, a [`Recorder::barrier_to_host`] behind it.
    pub fn record_download(&self, recorder: &mut Recorder<'_>) -> Result<()> {
        match &self.twin {
            Some(twin) => recorder.copy(self.whole(), 0, twin.whole(), 0, twin.size()),
            None => Ok(()),
        }
    }
}
