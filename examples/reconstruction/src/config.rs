//! How a network is trained, and what a step of it says.

use crate::fit_error;
use clap::Args;
use serde::{Deserialize, Serialize};
use softras::Result;

/// How a network is trained.
#[derive(Clone, Debug, PartialEq, Args, Serialize, Deserialize)]
pub struct Config {
    /// Channels of the first convolution; the official network has 64
    #[arg(long, default_value_t = 8)]
    pub width: usize,
    /// Steps in all
    #[arg(long, default_value_t = 4000)]
    pub steps: usize,
    /// Objects of a step, each in two views
    #[arg(long, default_value_t = 8)]
    pub pairs: usize,
    /// Adam's rate; × 0.3 after three fifths of the steps, as officially
    #[arg(long, default_value_t = 1e-3)]
    pub rate: f64,
    /// σ of the renderings
    #[arg(long, default_value_t = 1e-4)]
    pub sigma: f64,
    /// Weight of the Laplacian loss; officially 5e-3, for 250,000 steps of 64 pairs
    #[arg(long, default_value_t = 3e-2)]
    pub laplacian: f64,
    /// Weight of the flatten loss
    #[arg(long, default_value_t = 5e-4)]
    pub flatten: f64,
    /// Weight of the colour loss; 0 learns from silhouettes alone
    #[arg(long, default_value_t = 1.0)]
    pub color: f64,
    /// How colours are seen
    #[arg(long, default_value = "palette")]
    #[serde(default = "before_palettes")]
    pub coloring: Coloring,
    /// Compare hard images, differentiated in this way
    #[arg(long)]
    #[serde(default)]
    pub hard: Option<Hard>,
    /// Decides the first weights and the order of the pictures
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
}

/// How a network sees colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Coloring {
    /// Each vertex mixes a palette that the network samples from the picture, as in the paper
    Palette,
    /// Each vertex has a colour of its own
    Vertices,
}

/// How hard images are differentiated by positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Hard {
    /// As soft images whose edges are one pixel wide
    Edge,
}

/// The value for older checkpoints, which lack the field.
fn before_palettes() -> Coloring {
    Coloring::Vertices
}

impl Config {
    /// How the network sees colours, if it does.
    pub fn seen_colors(&self) -> Option<Coloring> {
        (self.color > 0.0).then_some(self.coloring)
    }

    /// Checks every number's range; the error names the field.
    pub fn validate(&self) -> Result<()> {
        let counts = [("width", self.width, 256), ("steps", self.steps, 10_000_000), ("pairs", self.pairs, 1024)];
        if let Some((name, value, most)) = counts.into_iter().find(|(_, value, most)| !(1..=*most).contains(value)) {
            return Err(fit_error(format!("{name} = {value}"), &format!("use 1 to {most}")));
        }
        let numbers = [
            ("rate", self.rate, 1e-9, 1.0),
            ("sigma", self.sigma, 1e-7, 1e-1),
            ("laplacian", self.laplacian, 0.0, 1e3),
            ("flatten", self.flatten, 0.0, 1e3),
            ("color", self.color, 0.0, 1e3),
        ];
        match numbers.into_iter().find(|(_, value, low, high)| !(low..=high).contains(&value)) {
            Some((name, value, low, high)) => {
                Err(fit_error(format!("{name} = {value}"), &format!("use {low:e} to {high:e}")))
            }
            None => Ok(()),
        }
    }
}

/// The losses of a step, each before its weight; that of the colours is 0 where a network does not see them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// The step, from 1.
    pub step: usize,
    /// In the order of [`Row::COLUMNS`].
    pub losses: [f32; 5],
}

impl Row {
    /// The names of the losses: the weighted sum of all, 1 - IoU of the silhouettes, the mean absolute difference of the
    /// colours, and the two that keep the surface smooth.
    pub const COLUMNS: [&str; 5] = ["loss", "silhouette", "color", "laplacian", "flatten"];

    /// The weighted sum of all losses.
    pub fn loss(&self) -> f32 {
        self.losses[0]
    }

    /// The mean IoU of the silhouettes.
    pub fn overlap(&self) -> f32 {
        1.0 - self.losses[1]
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
pub mod tests {
    use super::*;

    /// A training in small.
    pub fn small() -> Config {
        Config {
            width: 2,
            steps: 6,
            pairs: 2,
            rate: 1e-3,
            sigma: 1e-4,
            laplacian: 5e-3,
            flatten: 5e-4,
            color: 1.0,
            coloring: Coloring::Palette,
            hard: None,
            seed: 5,
        }
    }

    #[test]
    fn numbers_out_of_range_are_refused() {
        small().validate().unwrap();
        for (config, name) in [
            (Config { width: 0, ..small() }, "width"),
            (Config { rate: f64::NAN, ..small() }, "rate"),
            (Config { color: -1.0, ..small() }, "color"),
        ] {
            assert!(config.validate().unwrap_err().to_string().contains(name));
        }
    }

    #[test]
    fn what_older_checkpoints_say_is_read() {
        let said =
            r#"{"width":8,"steps":4,"pairs":8,"rate":1e-3,"sigma":1e-4,"laplacian":0,"flatten":0,"color":1,"seed":0}"#;
        let read: Config = serde_json::from_str(said).unwrap();
        assert_eq!((read.coloring, read.hard), (Coloring::Vertices, None));
    }
}
