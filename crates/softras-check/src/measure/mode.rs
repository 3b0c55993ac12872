//! The kinds of frame that are measured.

use softras::scene::{ColorAggregation, Distance, Outputs, SilhouetteAggregation};
use softras::{GradientRequest, Settings};

/// The images of a measured frame, and how they are made and differentiated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Colour alone.
    Color,
    /// The silhouette alone.
    Silhouette,
    /// Colour and silhouette, as the official renderer makes them.
    ColorSilhouette,
    /// Depth alone.
    Depth,
    /// Normals alone.
    Normal,
    /// Colour and silhouette of a plain z-buffer: the nearest covering triangle, without softness.
    Hard,
    /// Colour and silhouette, differentiated by the colours alone.
    ToColors,
    /// Colour and silhouette, differentiated by the camera alone.
    ToCamera,
}

impl Mode {
    /// All modes, beginning with the one that the others are compared with.
    pub const ALL: [Self; 8] = [
        Self::ColorSilhouette,
        Self::Color,
        Self::Silhouette,
        Self::Depth,
        Self::Normal,
        Self::Hard,
        Self::ToColors,
        Self::ToCamera,
    ];

    /// The name in tables and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Color => "color",
            Self::Silhouette => "silhouette",
            Self::ColorSilhouette => "color+silhouette",
            Self::Depth => "depth",
            Self::Normal => "normal",
            Self::Hard => "hard",
            Self::ToColors => "to-colors",
            Self::ToCamera => "to-camera",
        }
    }

    /// The images of a frame of this mode.
    pub fn outputs(self) -> Outputs {
        let both = matches!(self, Self::ColorSilhouette | Self::Hard | Self::ToColors | Self::ToCamera);
        Outputs {
            color: both || self == Self::Color,
            silhouette: both || self == Self::Silhouette,
            depth: self == Self::Depth,
            normal: self == Self::Normal,
            features: false,
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

    /// The inputs that a frame of this mode is differentiated by: vertex positions and, with a colour image, colours, unless
    /// the mode names other inputs.
    pub fn wanted(self) -> GradientRequest {
        match self {
            Self::ToColors => GradientRequest { colors: true, ..GradientRequest::NOTHING },
            Self::ToCamera => GradientRequest { camera: true, ..GradientRequest::NOTHING },
            _ => GradientRequest { positions: true, colors: self.outputs().color, ..GradientRequest::NOTHING },
        }
    }
}
