//! The tally of many cases: counts, worst errors and findings.

use serde_json::{Value, json};
use softras_check::stress::{Finding, Outcome};
use std::collections::BTreeMap;

/// The most findings that are kept with their texts.
const TOLD: usize = 50;

/// Counts, the worst errors with their seeds, and findings.
#[derive(Debug, Default)]
pub struct Tally {
    cases: u64,
    refused: BTreeMap<&'static str, u64>,
    found: BTreeMap<&'static str, u64>,
    findings: Vec<(u64, Finding)>,
    image: Worst,
    gradient: Worst,
    /// Errors of cases without a promise, for their quantiles.
    unpromised: Vec<f64>,
}

/// The largest of many errors, with its seed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Worst {
    count: u64,
    error: f64,
    seed: u64,
}

impl Worst {
    fn add(&mut self, seed: u64, error: Option<f64>) {
        let Some(error) = error else { return };
        self.count += 1;
        // If two errors are equal, the lower seed counts, so that the order of cases does not matter.
        if self.count == 1 || error > self.error || (error == self.error && seed < self.seed) {
            (self.error, self.seed) = (error, seed);
        }
    }

    fn merge(&mut self, other: Self) {
        if other.count > 0 {
            let count = self.count + other.count;
            self.add(other.seed, Some(other.error));
            self.count = count;
        }
    }
}

impl Tally {
    /// Adds the outcome of a case.
    pub fn add(&mut self, seed: u64, outcome: &Outcome) {
        self.cases += 1;
        if let Some(kind) = outcome.refused {
            *self.refused.entry(kind).or_default() += 1;
        }
        for finding in &outcome.findings {
            *self.found.entry(finding.kind).or_default() += 1;
            self.findings.push((seed, finding.clone()));
        }
        self.findings.truncate(TOLD);
        self.image.add(seed, outcome.image_error);
        self.gradient.add(seed, outcome.gradient_error);
        self.unpromised.extend(outcome.unpromised_error);
    }

    /// Adds the tally of another worker.
    pub fn merge(&mut self, other: Self) {
        self.cases += other.cases;
        other.refused.into_iter().for_each(|(kind, count)| *self.refused.entry(kind).or_default() += count);
        other.found.into_iter().for_each(|(kind, count)| *self.found.entry(kind).or_default() += count);
        self.findings.extend(other.findings);
        self.findings.sort_by_key(|(seed, _)| *seed);
        self.findings.truncate(TOLD);
        self.image.merge(other.image);
        self.gradient.merge(other.gradient);
        self.unpromised.extend(other.unpromised);
    }

    /// Whether there are no findings.
    pub fn is_clean(&self) -> bool {
        self.found.is_empty()
    }

    /// The first finding's seed and kind.
    pub fn first(&self) -> Option<(u64, &'static str)> {
        self.findings.first().map(|(seed, finding)| (*seed, finding.kind))
    }

    /// The share of the cases without a promise whose images have a larger error.
    fn beyond(&self, error: f64) -> f64 {
        self.unpromised.iter().filter(|e| **e > error).count() as f64 / self.unpromised.len().max(1) as f64
    }

    /// The tally as lines of text.
    pub fn lines(&self) -> Vec<String> {
        let counts = |counts: &BTreeMap<&str, u64>| {
            counts.iter().map(|(kind, count)| format!("{kind} {count}")).collect::<Vec<_>>().join(", ")
        };
        let refused: u64 = self.refused.values().sum();
        let mut lines = vec![
            format!("  {:8} rendered and differentiated twice", self.cases - refused),
            format!("  {refused:8} refused with an error: {}", counts(&self.refused)),
            format!(
                "  {:8} images against f64: at worst {:.2} of what is promised (seed {})",
                self.image.count, self.image.error, self.image.seed
            ),
            format!(
                "  {:8} gradients against f64: at worst off by {:.1e} of their norm (seed {})",
                self.gradient.count, self.gradient.error, self.gradient.seed
            ),
            format!(
                "  {:8} images of settings for which no error is promised: {:.1} % off by more than 1e-4, {:.1} % by 1e-2",
                self.unpromised.len(),
                100.0 * self.beyond(1e-4),
                100.0 * self.beyond(1e-2)
            ),
        ];
        if self.is_clean() {
            lines.push(format!("  PASS: no scene of {} breaks what is promised", self.cases));
            return lines;
        }
        lines.push(format!("  FAIL: {}", counts(&self.found)));
        lines.extend(self.findings.iter().map(|(seed, f)| format!("  seed {seed}: {}: {}", f.kind, f.what)));
        lines
    }

    /// The tally as JSON.
    pub fn json(&self) -> Value {
        let findings = self.findings.iter();
        let findings: Vec<_> =
            findings.map(|(seed, f)| json!({ "seed": seed, "kind": f.kind, "what": f.what })).collect();
        let worst = |w: &Worst| json!({ "count": w.count, "worst": w.error, "seed": w.seed });
        json!({
            "cases": self.cases, "refused": self.refused, "found": self.found, "findings": findings,
            "images": worst(&self.image), "gradients": worst(&self.gradient),
            "unpromised": { "count": self.unpromised.len(), "beyond_1e-4": self.beyond(1e-4), "beyond_1e-2": self.beyond(1e-2) },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finding_is_told_and_counted() {
        let mut tally = Tally::default();
        tally.add(3, &Outcome { refused: Some("settings"), ..Outcome::default() });
        assert!(tally.is_clean());
        let mut other = Tally::default();
        let finding = Finding { kind: "range", what: "colour 2".into() };
        other.add(4, &Outcome { findings: vec![finding], image_error: Some(0.5), ..Outcome::default() });
        tally.merge(other);
        assert!(!tally.is_clean());
        let text = tally.lines().join("\n");
        assert!(text.contains("seed 4: range: colour 2") && text.contains("settings 1"), "{text}");
        assert_eq!(tally.image, Worst { count: 1, error: 0.5, seed: 4 });
        assert_eq!(tally.json()["cases"], 2);
    }
}
