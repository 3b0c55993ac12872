//! How a network is trained, and what a step of it says.

use super::fit_error;
use serde::{Deserialize, Serialize};
use softras::Result;

/// How a network is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Config {
    /// Channels of the first convolution; 64 in the official network.
    pub width: usize,
    /// Steps in all.
    pub steps: usize,
    /// Objects of a step, each seen in two views.
    pub pairs: usize,
    /// Shares of a step of one size, each with batch norms of its own, whose mean gradient the step takes. Several processes
    /// divide the shares among them.
    #[serde(default = "one")]
    pub shares: usize,
    /// Adam's rate; × 0.3 after three fifths of the steps, as officially.
    pub rate: f64,
    /// σ of the renderings.
    pub sigma: f64,
    /// Weight of the Laplacian loss.
    pub laplacian: f64,
    /// Weight of the flatten loss.
    pub flatten: f64,
    /// Weight of the colour loss; 0 for a network of shapes alone.
    pub color: f64,
    /// How a network of colours sees them.
    #[serde(default = "before_palettes")]
    pub coloring: Coloring,
    /// For hard images in place of soft ones, how they are differentiated.
    #[serde(default, deserialize_with = "hard")]
    pub hard: Option<Hard>,
    /// Whether a voxel network learns from the training objects' solids, with none of the losses above.
    #[serde(default)]
    pub voxels: bool,
    /// Decides the first weights and the order of the pictures.
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
    /// As the Neural 3D Mesh Renderer of Kato et al. (2018) does, at twice the resolution
    Nmr,
}

fn one() -> usize {
    1
}

/// Checkpoints before there was a choice do not say it.
fn before_palettes() -> Coloring {
    Coloring::Vertices
}

/// Checkpoints before there was a choice say `true` for edges.
fn hard<'a, D: serde::Deserializer<'a>>(from: D) -> std::result::Result<Option<Hard>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Said {
        Before(bool),
        Now(Option<Hard>),
    }
    Ok(match Said::deserialize(from)? {
        Said::Before(hard) => hard.then_some(Hard::Edge),
        Said::Now(hard) => hard,
    })
}

impl Config {
    /// How the network sees colours, if it does.
    pub fn seen_colors(&self) -> Option<Coloring> {
        (self.color > 0.0).then_some(self.coloring)
    }

    /// Checks every number's range.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] naming the field.
    pub fn validate(&self) -> Result<()> {
        let counts = [("width", self.width, 256), ("steps", self.steps, 10_000_000), ("pairs", self.pairs, 1024)];
        if let Some((name, value, most)) = counts.into_iter().find(|(_, value, most)| !(1..=*most).contains(value)) {
            return fit_error(format!("{name} = {value}"), &format!("use 1 to {most}"));
        }
        if self.shares == 0 || !self.pairs.is_multiple_of(self.shares) {
            let what = format!("{} shares of {} pairs", self.shares, self.pairs);
            return fit_error(what, "use a number of pairs that is a multiple of the shares");
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
                fit_error(format!("{name} = {value}"), &format!("use {low:e} to {high:e}"))
            }
            None => Ok(()),
        }
    }
}

/// The losses of a step, each before its weight; those that a network does not have are 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The step, from 1.
    pub step: usize,
    /// The weighted sum of all; for a voxel network the cross entropy.
    pub loss: f32,
    /// 1 - IoU of the silhouettes.
    pub silhouette: f32,
    /// Mean absolute difference of the colours.
    pub color: f32,
    /// The Laplacian loss.
    pub laplacian: f32,
    /// The flatten loss.
    pub flatten: f32,
}

impl Row {
    /// The numbers of a row.
    pub const COLUMNS: [&str; 6] = ["step", "loss", "silhouette", "color", "laplacian", "flatten"];

    /// The losses in the order of [`Row::COLUMNS`].
    pub fn losses(&self) -> [f32; 5] {
        [self.loss, self.silhouette, self.color, self.laplacian, self.flatten]
    }

    /// A row of these losses.
    pub fn new(step: usize, [loss, silhouette, color, laplacian, flatten]: [f32; 5]) -> Self {
        Self { step, loss, silhouette, color, laplacian, flatten }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn what_older_checkpoints_say_is_read() {
        let config = |hard: &str| {
            let numbers =
                r#""width":8,"steps":4,"pairs":8,"rate":1e-3,"sigma":1e-4,"laplacian":0,"flatten":0,"color":1"#;
            serde_json::from_str::<Config>(&format!("{{{numbers}{hard},\"seed\":0}}"))
        };
        for (said, expected) in [
            ("", None),
            (r#","hard":false"#, None),
            (r#","hard":true"#, Some(Hard::Edge)),
            (r#","hard":null"#, None),
            (r#","hard":"edge""#, Some(Hard::Edge)),
            (r#","hard":"nmr""#, Some(Hard::Nmr)),
        ] {
            let read = config(said).unwrap();
            assert_eq!(read.hard, expected, "{said}");
            assert_eq!(read.coloring, Coloring::Vertices);
            let again: Config = serde_json::from_str(&serde_json::to_string(&read).unwrap()).unwrap();
            assert_eq!(again, read);
        }
        assert!(config(r#","hard":"soft""#).is_err());
    }
}
