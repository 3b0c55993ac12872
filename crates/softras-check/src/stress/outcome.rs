//! The outcome of running a case.

/// A violation of what must hold of every case.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Its kind: "panic", "not finite", "range", "bits", "error", "image", "gradient", "reference" or "validation".
    pub kind: &'static str,
    /// A description of what was found and where.
    pub what: String,
}

/// The result of running a case.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// The kind of error with which the case was refused, if it was.
    pub refused: Option<&'static str>,
    /// The violations.
    pub findings: Vec<Finding>,
    /// The largest error of the images that have a promise, in units of the tolerance; `None` without a promise.
    pub image_error: Option<f64>,
    /// The largest relative error of its gradients, where they were compared.
    pub gradient_error: Option<f64>,
    /// The largest error of any image of a case without a promise, in units of max(1, |value|).
    pub unpromised_error: Option<f64>,
}

impl Outcome {
    pub(super) fn find(&mut self, kind: &'static str, what: impl Into<String>) {
        self.findings.push(Finding { kind, what: what.into() });
    }
}
