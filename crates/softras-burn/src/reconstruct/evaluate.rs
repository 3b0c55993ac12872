//! The table: how far the shapes of networks, and of what needs no network, overlap the solids of unseen objects.

use super::data::{Object, Set};
use super::fill::Grid;
use super::network::Network;
use super::scores::Known;
use super::train::meshes;
use super::{VIEWS, fit_error};
use burn::tensor::Device;
use softras::Result;
use std::fmt;

/// The mean IoU of a method for each class, and the mean of these.
#[derive(Clone, Debug)]
pub struct Score {
    /// The method.
    pub name: String,
    /// One for each class of the set.
    pub classes: Vec<f64>,
}

impl Score {
    fn of(name: &str, set: &Set, mut iou: impl FnMut(&Object) -> Result<f64>) -> Result<Self> {
        let (mut sums, mut counts) = (vec![0.0; set.classes.len()], vec![0usize; set.classes.len()]);
        for object in &set.objects {
            sums[object.class] += iou(object)?;
            counts[object.class] += 1;
        }
        let classes = sums.iter().zip(counts).map(|(sum, count)| sum / count.max(1) as f64).collect();
        Ok(Self { name: name.into(), classes })
    }

    /// The mean over classes.
    pub fn mean(&self) -> f64 {
        self.classes.iter().sum::<f64>() / self.classes.len().max(1) as f64
    }
}

/// Scores of several methods.
#[derive(Clone, Debug)]
pub struct Table {
    /// The classes.
    pub classes: Vec<String>,
    /// A row for each method.
    pub rows: Vec<Score>,
}

/// As a table of Markdown.
impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| method | {} | mean |", self.classes.join(" | "))?;
        writeln!(f, "| --- |{}", " ---: |".repeat(self.classes.len() + 1))?;
        for row in &self.rows {
            let cells: String = row.classes.iter().map(|iou| format!(" {iou:.3} |")).collect();
            writeln!(f, "| {} |{cells} {:.3} |", row.name, row.mean())?;
        }
        Ok(())
    }
}

/// The views that a number of them is: spread evenly.
fn views(count: usize) -> impl Iterator<Item = usize> {
    (0..count).map(move |i| i * VIEWS / count)
}

/// The table of a test set. Every score is a mean over `count` views of every object.
///
/// # Errors
/// [`softras::Error::Fit`] for a number of views outside 1 to 24; as [`meshes`].
pub fn table(train: &Set, test: &Set, networks: &[(String, Network)], count: usize, device: &Device) -> Result<Table> {
    if !(1..=VIEWS).contains(&count) {
        return fit_error(format!("{count} views"), "use 1 to 24");
    }
    let known = Known::new(train);
    let over_views = |object: &Object, of: &dyn Fn(&[u8]) -> f64| {
        views(count).map(|view| of(object.picture(view))).sum::<f64>() / count as f64
    };
    let class = |object: &Object| &test.classes[object.class];
    let mut rows = vec![
        Score::of("best training shape (oracle)", test, |object| Ok(known.best(object)))?,
        Score::of("mean shape", test, |object| Ok(known.mean().iou(&object.solid)))?,
        Score::of("mean shape of the family", test, |object| Ok(known.mean_of(class(object)).iou(&object.solid)))?,
        Score::of("retrieval by picture", test, |object| {
            Ok(over_views(object, &|picture| known.by_picture(picture).iou(&object.solid)))
        })?,
        Score::of("retrieval by silhouette", test, |object| {
            Ok(over_views(object, &|picture| known.by_silhouette(picture).iou(&object.solid)))
        })?,
    ];
    for (name, network) in networks {
        rows.push(Score::of(name, test, |object| {
            let pictures: Vec<&[u8]> = views(count).map(|view| object.picture(view)).collect();
            let mut sum = 0.0;
            for mesh in meshes(network, &pictures, device)? {
                sum += Grid::new(&mesh)?.iou(&object.solid);
            }
            Ok(sum / count as f64)
        })?);
    }
    Ok(Table { classes: test.classes.clone(), rows })
}
