//! The kinds of frame that are measured.

use crate::scene::{ColorAggregation, Distance, Outputs, SilhouetteAggregation};
use crate::{Settings, Wanted};

/// Which images a measured frame makes, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Colour alone.
    Color,
    /// The silhouette alone.
    Silhouette,
    /// Both, as the official renderer makes them.
    ColorSilhouette,
    /// Depth alone.
    Depth,
    /// Normals alone.
    Normal,
    /// Colour and silhouette of a plain z-buffer: nearest covering triangle, nothing soft.
    Hard,
}

impl Mode {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Color, Self::Silhouette, Self::ColorSilhouette, Self::Depth, Self::Normal, Self::Hard];

    /// As in tables and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Color => "color",
            Self::Silhouette => "silhouette",
            Self::ColorSilhouette => "color+silhouette",
            Self::Depth => "depth",
            Self::Normal => "normal",
            Self::Hard => "hard",
        }
    }

    /// The images of a frame of this mode.
    pub fn outputs(self) -> Outputs {
        Outputs {
            color: matches!(self, Self::Color | Self::ColorSilhouette | Self::Hard),
            silhouette: matches!(self, Self::Silhouette | Self::ColorSilhouette | Self::Hard),
            depth: self == Self::Depth,
            normal: self == Self::Normal,
        }
    }

    /// The settings with this mode's images.
    pub fn of(self, settings: &Settings) -> Settings {
        let settings = Settings { outputs: self.outputs(), ..settings.clone() };
        match self {
            Self::Hard => Settings {
                color: ColorAggregation::Hard,
                silhouette: SilhouetteAggregation::Hard,
                distance: Distance::Hard,
                ..settings
            },
            _ => settings,
        }
    }

    /// What a frame of this mode is differentiated by: vertex positions, and colours where there are any.
    pub fn wanted(self) -> Wanted {
        Wanted { positions: true, colors: self.outputs().color, ..Wanted::NOTHING }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outputs_are_those_named() {
        for mode in Mode::ALL.into_iter().filter(|mode| *mode != Mode::Hard) {
            let o = mode.outputs();
            let names = [(o.color, "color"), (o.silhouette, "silhouette"), (o.depth, "depth"), (o.normal, "normal")];
            let made: Vec<_> = names.into_iter().filter(|(on, _)| *on).map(|(_, name)| name).collect();
            assert_eq!(made.join("+"), mode.name());
        }
    }
}
