//! The kernels that few frames need, and that take long to compile.

/// Those that are compiled and recorded. Only the device finds out whether a frame needs them: its status tells, and a program
/// that looks at it plans the frame again with them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rare {
    /// What finds no room in a list is found again where it is needed.
    pub walked: bool,
    /// Of a frame of the soft model, tiles with a triangle too thin for forward_soft are drawn by forward.
    pub thin: bool,
    /// Backward processes boxes of more pixels than LARGE_BOX, and of several cells.
    pub large: bool,
}

impl Rare {
    /// All of them, with which every frame is complete.
    pub const ALL: Self = Self { walked: true, thin: true, large: true };
}
