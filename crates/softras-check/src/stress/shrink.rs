//! Reduces a scene to the fewest triangles that still show a finding.

use super::draw::Case;
use super::run::Stress;
use softras::{Result, Scene};

impl Stress {
    /// Leaves out triangles, first half of them and at last one at a time, as long as the case still has a finding of that
    /// kind.
    ///
    /// # Errors
    /// As [`Stress::run`].
    pub fn shrink(&mut self, case: &Case, kind: &str) -> Result<Case> {
        let mut best = case.clone();
        let count = |case: &Case| case.scene.meshes.first().map_or(0, |mesh| mesh.triangles().len());
        let mut size = count(&best);
        while size > 0 {
            let mut first = 0;
            while first < count(&best) {
                let kept: Vec<usize> = (0..count(&best)).filter(|t| !(first..first + size).contains(t)).collect();
                let mesh = best.scene.meshes[0].part(&kept)?;
                let scene = Scene::new(mesh).with_lights(best.scene.lights.clone());
                let smaller = Case { scene, ..best.clone() };
                if self.run(&smaller)?.findings.iter().any(|finding| finding.kind == kind) {
                    best = smaller;
                } else {
                    first += size;
                }
            }
            size /= 2;
        }
        Ok(best)
    }
}
