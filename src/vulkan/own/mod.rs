//! A device of our own: opened, with its memory, its queue and its pipeline cache on disk. Only the renderer needs it.

mod access;
mod allocation;
mod buffer;
mod command;
mod context;
mod disk_cache;
mod instance;
mod loader;
mod select;
mod validation;

pub(super) use access::Access;
pub use access::{Mapped, MappedMut};
pub use buffer::Buffer;
pub use command::CommandBuffer;
pub use context::{Context, ContextOptions};
pub use disk_cache::CacheFolder;
pub(super) use disk_cache::DiskCache;
pub(super) use instance::Instance;
pub use loader::Loader;
