//! Positions as smoothed parameters: "Large Steps in Inverse Rendering of Geometry" (Nicolet, Jacobson, Jakob 2021).
//!
//! The parameters are u = (I + λ L) x with L the mesh's graph Laplacian (degree on the diagonal, -1 for an edge), so
//! x = (I + λ L)⁻¹ u, and dL/du = (I + λ L)⁻¹ dL/dx. A step in u moves neighbouring vertices together where a step
//! in x would move single vertices, and every shape can still be reached. The matrix is factored once, by Cholesky
//! within its envelope after a reverse Cuthill-McKee ordering: for a mesh of n vertices the envelope has about n·√n
//! entries. It is our own: faer's takes a third of the time at 16,000 vertices and as much at 4,000, where a solve is 2 % of
//! a step, but 23 crates and 140 s of compile time.

use crate::bad;
use crate::mesh::topology::Topology;
use crate::shown;
use glam::DVec3;
use softras::Result;
use std::collections::VecDeque;

/// The largest number of entries of the factor, 2 GiB of them.
const MOST_ENTRIES: usize = 1 << 28;

/// The factored matrix I + λ L of a mesh.
#[derive(Clone, Debug)]
pub struct Smoothing {
    lambda: f64,
    topology: Topology,
    /// The vertex of each row of the ordered matrix.
    order: Vec<u32>,
    /// For each row of the factor its first column within the envelope.
    first: Vec<usize>,
    /// Where each row begins in `entries`; a row ends with its diagonal entry.
    start: Vec<usize>,
    entries: Vec<f64>,
}

impl Smoothing {
    /// Factors the matrix of a mesh; λ of 10 to 50 is usual, 0 smooths nothing.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] for a λ that is negative or not finite, or a mesh whose factor needs over 2 GiB.
    pub fn new(topology: &Topology, lambda: f64) -> Result<Self> {
        if !(0.0..=1e9).contains(&lambda) {
            return bad(format!("a smoothing of λ = {}", shown(lambda)), "use 0 to 1e9; 10 to 50 is usual");
        }
        let order = cuthill_mckee(topology);
        let mut row_of = vec![0usize; order.len()];
        order.iter().enumerate().for_each(|(at, &vertex)| row_of[vertex as usize] = at);
        let first_of = |(at, &vertex): (usize, &u32)| {
            let lowest = topology.neighbors(vertex as usize).iter().map(|&j| row_of[j as usize]).min();
            lowest.map_or(at, |low| low.min(at))
        };
        let first: Vec<usize> = order.iter().enumerate().map(first_of).collect();
        let mut start = vec![0usize];
        for (row, first) in first.iter().enumerate() {
            start.push(start[row] + row + 1 - first);
        }
        let count = start.last().copied().unwrap_or(0);
        if count > MOST_ENTRIES {
            return bad(format!("a factor of {count} entries"), "use a mesh with fewer vertices, or another optimiser");
        }
        let mut entries = vec![0.0; count];
        for (row, &vertex) in order.iter().enumerate() {
            let neighbors = topology.neighbors(vertex as usize);
            entries[start[row + 1] - 1] = 1.0 + lambda * neighbors.len() as f64;
            for column in neighbors.iter().map(|&j| row_of[j as usize]).filter(|&column| column < row) {
                entries[start[row] + column - first[row]] = -lambda;
            }
        }
        let mut smoothing = Self { lambda, topology: topology.clone(), order, first, start, entries };
        smoothing.factor();
        Ok(smoothing)
    }

    /// Computes Cholesky's factor within the envelope, row by row. It exists, since the matrix is strictly diagonally
    /// dominant and so positive definite.
    fn factor(&mut self) {
        for row in 0..self.order.len() {
            let (done, rest) = self.entries.split_at_mut(self.start[row]);
            let (first, length) = (self.first[row], row + 1 - self.first[row]);
            for column in first..row {
                let from = self.first[column].max(first);
                let above = &done[self.start[column] + from - self.first[column]..self.start[column + 1]];
                let (diagonal, above) = (above[above.len() - 1], &above[..above.len() - 1]);
                let sum: f64 = above.iter().zip(&rest[from - first..]).map(|(a, b)| a * b).sum();
                rest[column - first] = (rest[column - first] - sum) / diagonal;
            }
            let sum: f64 = rest[..length - 1].iter().map(|x| x * x).sum();
            rest[length - 1] = (rest[length - 1] - sum).sqrt();
        }
    }

    fn row(&self, row: usize) -> &[f64] {
        &self.entries[self.start[row]..self.start[row + 1]]
    }

    /// Multiplies one vector for each vertex by (I + λ L)⁻¹, in place: parameters become positions, and dL/dpositions
    /// becomes dL/dparameters.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] unless there is one vector for each vertex.
    pub fn apply(&self, vectors: &mut [DVec3]) -> Result<()> {
        self.validate(vectors.len())?;
        let mut solved: Vec<DVec3> = self.order.iter().map(|&i| vectors[i as usize]).collect();
        for row in 0..solved.len() {
            let (entries, first) = (self.row(row), self.first[row]);
            let (diagonal, entries) = (entries[entries.len() - 1], &entries[..entries.len() - 1]);
            let sum: DVec3 = entries.iter().zip(&solved[first..row]).map(|(l, x)| *l * *x).sum();
            solved[row] = (solved[row] - sum) / diagonal;
        }
        for row in (0..solved.len()).rev() {
            let (entries, first) = (self.row(row), self.first[row]);
            let x = solved[row] / entries[entries.len() - 1];
            solved[row] = x;
            solved[first..row].iter_mut().zip(entries).for_each(|(y, l)| *y -= *l * x);
        }
        self.order.iter().zip(solved).for_each(|(&i, x)| vectors[i as usize] = x);
        Ok(())
    }

    /// One vector for each vertex multiplied by I + λ L: positions become parameters.
    ///
    /// # Errors
    /// As [`Smoothing::apply`].
    pub fn undo(&self, vectors: &[DVec3]) -> Result<Vec<DVec3>> {
        self.validate(vectors.len())?;
        let one = |(i, &x): (usize, &DVec3)| {
            let neighbors = self.topology.neighbors(i);
            let sum: DVec3 = neighbors.iter().map(|&j| vectors[j as usize]).sum();
            x + self.lambda * (neighbors.len() as f64 * x - sum)
        };
        Ok(vectors.iter().enumerate().map(one).collect())
    }

    fn validate(&self, count: usize) -> Result<()> {
        if count == self.order.len() {
            return Ok(());
        }
        bad(format!("{count} vectors for {} vertices", self.order.len()), "give one for each vertex")
    }
}

/// The reverse Cuthill-McKee ordering: for each component breadth first from a vertex at its rim, then all reversed.
fn cuthill_mckee(topology: &Topology) -> Vec<u32> {
    let count = topology.vertices();
    // How often each vertex was visited: three walks visit all of a component.
    let mut visits = vec![0u8; count];
    let mut order = Vec::with_capacity(count);
    for seed in 0..count {
        if visits[seed] > 0 {
            continue;
        }
        // The last vertex of a breadth-first walk lies far from its start; after two walks it is close to the rim.
        let mut start = seed;
        for _ in 0..2 {
            let walked = walk(topology, start, &mut visits);
            start = walked.last().map_or(start, |&i| i as usize);
        }
        order.extend(walk(topology, start, &mut visits));
    }
    order.reverse();
    order
}

/// Breadth-first order from `start`; a vertex's neighbours are visited in the order of their degrees. All that it reaches was visited
/// equally often before.
fn walk(topology: &Topology, start: usize, visits: &mut [u8]) -> Vec<u32> {
    let mut order = Vec::new();
    let mut waiting = VecDeque::from([start as u32]);
    let before = visits[start];
    visits[start] += 1;
    while let Some(vertex) = waiting.pop_front() {
        order.push(vertex);
        let mut next: Vec<u32> = topology.neighbors(vertex as usize).to_vec();
        next.retain(|&j| visits[j as usize] == before);
        next.sort_by_key(|&j| (topology.neighbors(j as usize).len(), j));
        for j in next {
            visits[j as usize] += 1;
            waiting.push_back(j);
        }
    }
    order
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::points;
    use softras::shapes;
    use std::time::{Duration, Instant};

    /// 13 s where each of them took time that grows with their number.
    #[test]
    fn each_of_many_parts_is_ordered_by_itself() {
        let triangles: Vec<[u32; 3]> = (0..100_000).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let topology = Topology::new(300_000, &triangles).unwrap();
        let began = Instant::now();
        let order = cuthill_mckee(&topology);
        assert!(began.elapsed() < Duration::from_secs(6), "{:?}", began.elapsed());
        assert!(order.chunks(3).all(|part| part.iter().all(|v| v / 3 == part[0] / 3)));
    }

    #[test]
    fn smoothing_solves_its_system() {
        let mesh = shapes::icosphere(3).unwrap();
        // An isolated vertex is a component of its own.
        let topology = Topology::new(mesh.positions().len() + 1, mesh.triangles()).unwrap();
        let mut positions = points(&mesh);
        positions.push(DVec3::new(3.0, 4.0, 5.0));
        let smoothing = Smoothing::new(&topology, 19.0).unwrap();
        let mut solved = smoothing.undo(&positions).unwrap();
        let distance = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(distance(&solved, &positions) > 0.1, "a smoothing of 19 does something");
        smoothing.apply(&mut solved).unwrap();
        assert!(distance(&solved, &positions) < 1e-10, "{}", distance(&solved, &positions));
        // A step of one vertex moves its surroundings, and the sum of all steps stays.
        let mut step = vec![DVec3::ZERO; positions.len()];
        step[100] = DVec3::X;
        smoothing.apply(&mut step).unwrap();
        let neighbor = topology.neighbors(100)[0] as usize;
        assert!(step[100].x < 0.5 && step[neighbor].x > 0.2 * step[100].x && step[neighbor].x < step[100].x);
        assert!((step.iter().map(|s| s.x).sum::<f64>() - 1.0).abs() < 1e-10);
        assert!(Smoothing::new(&topology, f64::NAN).is_err() && smoothing.apply(&mut [DVec3::ZERO; 3]).is_err());
    }
}
