//! The objects that a command buffer of ours keeps alive until the device is done with it.

use std::sync::Arc;

/// An object that must live until the device is done with it.
pub(super) type Keep = Arc<dyn Kept>;

/// An object that can be kept.
pub(super) trait Kept: Send + Sync {
    /// Adds the mapped buffers and the timestamp marks that it uses.
    #[cfg(feature = "renderer")]
    fn uses(&self, _uses: &mut Uses) {}
}

/// The mapped buffers and the timestamp marks that recorded commands use.
#[cfg(feature = "renderer")]
#[derive(Default)]
pub(super) struct Uses {
    /// Buffers that the host can map.
    pub(super) mapped: Vec<Arc<super::own::Access>>,
    /// Marks of timestamp pools, set once the commands have been executed.
    pub(super) timestamps: Vec<Arc<std::sync::atomic::AtomicBool>>,
}

#[cfg(feature = "renderer")]
impl Uses {
    /// The uses of the kept objects, each mapped buffer once.
    pub(super) fn of(kept: &[Keep]) -> Self {
        let mut uses = Self::default();
        kept.iter().for_each(|keep| keep.uses(&mut uses));
        uses.mapped.sort_unstable_by_key(Arc::as_ptr);
        uses.mapped.dedup_by_key(|access| Arc::as_ptr(access));
        uses
    }

    /// Begins the device's use of the mapped buffers: of all or, on an error, of none.
    pub(super) fn begin(&self) -> crate::Result<()> {
        for (begun, access) in self.mapped.iter().enumerate() {
            if let Err(error) = access.by_device() {
                self.mapped[..begun].iter().for_each(|access| access.end_by_device());
                return Err(error);
            }
        }
        Ok(())
    }

    /// Ends the device's use, where the commands were never submitted.
    pub(super) fn cancel(&self) {
        self.mapped.iter().for_each(|access| access.end_by_device());
    }

    /// Ends the device's use: the commands have been executed.
    pub(super) fn end(&self) {
        self.timestamps.iter().for_each(|mark| mark.store(true, std::sync::atomic::Ordering::Release));
        self.cancel();
    }
}
