//! The kernels that few frames need, and that take long to compile.

/// Which of these kernels are compiled and recorded. Only the device finds out whether a frame needs them: its status
/// says so, and a program that reads it plans the frame again with them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rare {
    /// Entries without room in a list are found again where they are needed.
    pub walked: bool,
    /// In a frame of the soft model, forward draws the tiles with a triangle too thin for forward_soft.
    pub thin: bool,
    /// Backward processes boxes of several cells or of more pixels than LARGE_BOX.
    pub large: bool,
}

impl Rare {
    /// All of them: every frame is complete.
    pub const ALL: Self = Self { walked: true, thin: true, large: true };
}
