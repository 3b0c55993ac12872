//! The table: how far the shapes of networks, and of methods without a network, overlap the solids of unseen objects.

use crate::VIEWS;
use crate::data::{Object, Set};
use crate::fill::solid;
use crate::network::{Network, meshes};
use crate::scores::Known;
use burn::tensor::Device;
use softras::Result;
use std::fmt;

/// Scores of several methods on a test set.
#[derive(Clone, Debug)]
pub struct Table {
    /// The heading of the first column.
    head: &'static str,
    classes: Vec<String>,
    /// For each method its name and its runs, each with one score for each class. A method that is no network has one run.
    pub rows: Vec<(String, Vec<Vec<f64>>)>,
}

impl Table {
    /// A table without rows.
    pub fn new(head: &'static str, test: &Set) -> Self {
        Self { head, classes: test.classes.clone(), rows: Vec::new() }
    }

    /// Adds a run of a method, to its row where it has one: the means over the objects of each class.
    pub fn add(&mut self, name: &str, test: &Set, mut of: impl FnMut(&Object) -> Result<f64>) -> Result<()> {
        let mut scores = vec![Vec::new(); self.classes.len()];
        for object in &test.objects {
            scores[object.class].push(of(object)?);
        }
        let run = scores.into_iter().map(mean).collect();
        match self.rows.iter_mut().find(|row| row.0 == name) {
            Some(row) => row.1.push(run),
            None => self.rows.push((name.into(), vec![run])),
        }
        Ok(())
    }
}

/// The mean of some numbers, of none 0.
pub fn mean(numbers: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = numbers.into_iter().fold((0.0, 0), |(sum, count), x| (sum + x, count + 1));
    sum / f64::from(count.max(1))
}

/// As a table of Markdown: means over runs and, where there are several, the least and the largest mean of a run.
impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| {} | {} | mean |", self.head, self.classes.join(" | "))?;
        writeln!(f, "| --- |{}", " ---: |".repeat(self.classes.len() + 1))?;
        for (name, runs) in &self.rows {
            let cell = |class: usize| format!(" {:.3} |", mean(runs.iter().map(|run| run[class])));
            let cells: String = (0..self.classes.len()).map(cell).collect();
            let means: Vec<f64> = runs.iter().map(|run| mean(run.iter().copied())).collect();
            let (least, most) = means.iter().fold((f64::MAX, f64::MIN), |(l, m), &x| (l.min(x), m.max(x)));
            let spread = if means.len() > 1 { format!(" ({least:.3} to {most:.3})") } else { String::new() };
            writeln!(f, "| {name} |{cells} {:.3}{spread} |", mean(means))?;
        }
        Ok(())
    }
}

/// Some views, spread evenly.
pub fn views(count: usize) -> impl Iterator<Item = usize> {
    (0..count).map(move |i| i * VIEWS / count)
}

/// The table of a test set. Every score is a mean over `count` views of every object. Networks of one name are the runs of one
/// row.
pub fn table(train: &Set, test: &Set, networks: &[(String, Network)], count: usize, device: &Device) -> Result<Table> {
    let known = Known::new(train);
    let seen = |object: &Object, of: &dyn Fn(&[u8]) -> f64| Ok(mean(views(count).map(|view| of(object.picture(view)))));
    let mut table = Table::new("method", test);
    table.add("best training shape (oracle)", test, |object| Ok(known.best(object)))?;
    table.add("mean shape", test, |object| Ok(known.mean(object)))?;
    table.add("mean shape of the family", test, |object| Ok(known.mean_of(&test.classes[object.class], object)))?;
    table.add("retrieval by picture", test, |object| {
        seen(object, &|picture| known.by_picture(picture).solid.iou(&object.solid))
    })?;
    table.add("retrieval by silhouette", test, |object| {
        seen(object, &|picture| known.by_silhouette(picture).solid.iou(&object.solid))
    })?;
    for (name, network) in networks {
        table.add(name, test, |object| {
            let pictures: Vec<&[u8]> = views(count).map(|view| object.picture(view)).collect();
            let solids = meshes(network, &pictures, device)?.iter().map(solid).collect::<Result<Vec<_>>>()?;
            Ok(mean(solids.iter().map(|solid| solid.iou(&object.solid))))
        })?;
    }
    Ok(table)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::config::Coloring;
    use crate::synthesis;

    #[test]
    fn a_row_of_several_runs_says_their_spread() {
        let rows = vec![
            ("three".into(), vec![vec![0.5, 0.3], vec![0.6, 0.4], vec![0.55, 0.2]]),
            ("one".into(), vec![vec![0.25, 0.5]]),
        ];
        let table = Table { head: "method", classes: vec!["a".into(), "b".into()], rows }.to_string();
        assert!(table.contains("| three | 0.550 | 0.300 | 0.425 (0.375 to 0.500) |"), "{table}");
        assert!(table.contains("| one | 0.250 | 0.500 | 0.375 |"), "{table}");
    }

    #[test]
    fn the_table_has_every_row() {
        let (set, device) = (synthesis::tests::small(), Device::flex());
        let network = Network::new(2, Some(Coloring::Palette), &device).unwrap();
        let table = table(&set, &set, &[("new".into(), network)], 2, &device).unwrap();
        // The test set is the training set here, so that the nearest training shape is the shape itself.
        let own = 1.0..=1.0;
        let expected = [own.clone(), 0.05..=0.95, 0.05..=0.95, own.clone(), own, 0.05..=0.95];
        assert_eq!(table.rows.len(), expected.len());
        for ((name, runs), expected) in table.rows.iter().zip(expected) {
            assert!(runs[0].iter().all(|score| expected.contains(score)), "{name}: {runs:?}");
        }
    }
}
