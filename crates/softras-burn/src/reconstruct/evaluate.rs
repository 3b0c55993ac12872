//! The table: how far the shapes of networks, and of what needs no network, overlap the solids of unseen objects.

use super::data::{Object, Set};
use super::fill::Grid;
use super::model::Model;
use super::network::meshes;
use super::scores::Known;
use super::{VIEWS, fit_error};
use burn::tensor::Device;
use softras::Result;
use std::fmt;

/// The mean IoU, or colour error, of a method for each class, and the mean of these.
#[derive(Clone, Debug)]
pub struct Score {
    /// The method.
    pub name: String,
    /// For each run, one for each class of the set; a method that is no network has one run.
    pub runs: Vec<Vec<f64>>,
}

impl Score {
    fn of(name: &str, set: &Set, iou: impl FnMut(&Object) -> Result<f64>) -> Result<Self> {
        Ok(Self { name: name.into(), runs: vec![by_class(set, iou)?] })
    }

    /// The mean over runs for each class.
    pub fn classes(&self) -> Vec<f64> {
        let count = self.runs.first().map_or(0, Vec::len);
        (0..count).map(|class| mean(self.runs.iter().map(|run| run[class]))).collect()
    }

    /// The mean over classes of each run.
    pub fn means(&self) -> Vec<f64> {
        self.runs.iter().map(|run| mean(run.iter().copied())).collect()
    }

    /// The mean over classes and runs.
    pub fn mean(&self) -> f64 {
        mean(self.means().into_iter())
    }
}

/// The mean of some numbers, of none 0.
pub(super) fn mean(numbers: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = numbers.len().max(1);
    numbers.sum::<f64>() / count as f64
}

/// The means over the objects of each class.
pub(super) fn by_class(set: &Set, mut of: impl FnMut(&Object) -> Result<f64>) -> Result<Vec<f64>> {
    let (mut sums, mut counts) = (vec![0.0; set.classes.len()], vec![0usize; set.classes.len()]);
    for object in &set.objects {
        sums[object.class] += of(object)?;
        counts[object.class] += 1;
    }
    Ok(sums.iter().zip(counts).map(|(sum, count)| sum / count.max(1) as f64).collect())
}

/// Scores of several methods.
#[derive(Clone, Debug)]
pub struct Table {
    /// What the first column is headed by.
    pub head: String,
    /// The classes.
    pub classes: Vec<String>,
    /// A row for each method.
    pub rows: Vec<Score>,
}

/// As a table of Markdown: means over runs and, where there are several, the least and the largest mean of a run.
impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| {} | {} | mean |", self.head, self.classes.join(" | "))?;
        writeln!(f, "| --- |{}", " ---: |".repeat(self.classes.len() + 1))?;
        for row in &self.rows {
            let cells: String = row.classes().iter().map(|iou| format!(" {iou:.3} |")).collect();
            let means = row.means();
            let (least, most) = means.iter().fold((f64::MAX, f64::MIN), |(l, m), &x| (l.min(x), m.max(x)));
            let spread = if means.len() > 1 { format!(" ({least:.3} to {most:.3})") } else { String::new() };
            writeln!(f, "| {} |{cells} {:.3}{spread} |", row.name, row.mean())?;
        }
        Ok(())
    }
}

/// The views that a number of them is: spread evenly.
pub(super) fn views(count: usize) -> impl ExactSizeIterator<Item = usize> {
    (0..count).map(move |i| i * VIEWS / count)
}

/// Checks a number of views.
///
/// # Errors
/// [`softras::Error::Fit`] outside 1 to 24.
pub(super) fn check_views(count: usize) -> Result<()> {
    if (1..=VIEWS).contains(&count) { Ok(()) } else { fit_error(format!("{count} views"), "use 1 to 24") }
}

/// Adds a run of a method, to its row where it has one.
pub(super) fn add_run(rows: &mut Vec<Score>, name: &str, run: Vec<f64>) {
    match rows.iter_mut().find(|row| row.name == name) {
        Some(row) => row.runs.push(run),
        None => rows.push(Score { name: name.into(), runs: vec![run] }),
    }
}

/// The table of a test set. Every score is a mean over `count` views of every object. Networks of one name are the runs of one
/// row.
///
/// # Errors
/// [`softras::Error::Fit`] for a number of views outside 1 to 24; as [`meshes`].
pub fn table(train: &Set, test: &Set, networks: &[(String, Model)], count: usize, device: &Device) -> Result<Table> {
    check_views(count)?;
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
            Ok(over_views(object, &|picture| known.by_picture(picture).solid.iou(&object.solid)))
        })?,
        Score::of("retrieval by silhouette", test, |object| {
            Ok(over_views(object, &|picture| known.by_silhouette(picture).solid.iou(&object.solid)))
        })?,
    ];
    for (name, network) in networks {
        let run = by_class(test, |object| {
            let pictures: Vec<&[u8]> = views(count).map(|view| object.picture(view)).collect();
            let seen = solids(network, &pictures, device)?;
            Ok(mean(seen.iter().map(|solid| solid.iou(&object.solid))))
        })?;
        add_run(&mut rows, name, run);
    }
    Ok(Table { head: "method".into(), classes: test.classes.clone(), rows })
}

/// The solids that a network sees in pictures.
fn solids(network: &Model, pictures: &[&[u8]], device: &Device) -> Result<Vec<Grid>> {
    match network {
        Model::Mesh(network) => meshes(network, pictures, device)?.iter().map(Grid::new).collect(),
        Model::Voxels(network) => network.solids(pictures, device),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_of_several_runs_says_their_spread() {
        let score = Score { name: "three".into(), runs: vec![vec![0.5, 0.3], vec![0.6, 0.4], vec![0.55, 0.2]] };
        assert_eq!(score.classes().len(), 2);
        let alone = Score { name: "one".into(), runs: vec![vec![0.25, 0.5]] };
        let table = Table { head: "method".into(), classes: vec!["a".into(), "b".into()], rows: vec![score, alone] }
            .to_string();
        assert!(table.contains("| three | 0.550 | 0.300 | 0.425 (0.375 to 0.500) |"), "{table}");
        assert!(table.contains("| one | 0.250 | 0.500 | 0.375 |"), "{table}");
    }
}
