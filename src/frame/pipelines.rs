//! Pipelines, compiled when a plan first needs them and kept for later plans.

use crate::error::{Error, Result};
use crate::vulkan::{Device, Kernel, Pipeline, PipelineCache, SpecValue};

/// The most pipelines that are kept. Each takes up to some megabytes in a driver, and few programs use more than two sets
/// of modes.
const MOST_PIPELINES: usize = 128;

/// The specialization constants that a kernel has, by name and value.
type Values = Vec<(&'static str, SpecValue)>;

/// The pipeline that a stage needs: a kernel, and the modes of the whole frame by their names in GLSL.
pub struct Request<'a> {
    /// The kernel.
    pub kernel: &'static Kernel,
    /// The frame's modes. Those that the kernel does not have are ignored.
    pub modes: &'a [(&'static str, u32)],
    /// Invocations of its workgroup, if its size is a specialization constant.
    pub lanes: u32,
}

impl Request<'_> {
    fn values(&self) -> Values {
        let typed = |default: SpecValue, value: u32| match default {
            SpecValue::Bool(_) => SpecValue::Bool(value != 0),
            _ => SpecValue::Uint(value),
        };
        let known = self.kernel.specialization.iter().filter_map(|constant| {
            let given = self.modes.iter().find(|(name, _)| *name == constant.name).map(|(_, value)| *value);
            let value = given.or_else(|| (constant.name == "local_size_x").then_some(self.lanes))?;
            Some((constant.name, typed(constant.default, value)))
        });
        known.collect()
    }
}

/// The pipelines compiled so far, each with the values of the specialization constants of its kernel.
#[derive(Debug, Default)]
pub struct Pipelines {
    made: Vec<(&'static str, Values, Pipeline)>,
}

impl Pipelines {
    fn find(&self, kernel: &Kernel, values: &Values) -> Option<&Pipeline> {
        self.made.iter().find(|(name, v, _)| *name == kernel.name && v == values).map(|(_, _, pipeline)| pipeline)
    }

    /// A pipeline for every request, in order. New ones are compiled in parallel.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`], [`crate::Error::Limit`] when one cannot be compiled.
    pub fn get<const N: usize>(
        &mut self,
        device: &Device,
        cache: Option<&PipelineCache>,
        requests: [Request<'_>; N],
    ) -> Result<[Pipeline; N]> {
        let wanted = requests.map(|request| (request.kernel, request.values()));
        let mut pipelines = Vec::with_capacity(N);
        for made in self.find_or_make(device, cache, &wanted) {
            pipelines.push(made?);
        }
        for ((kernel, values), pipeline) in wanted.iter().zip(&pipelines) {
            if self.find(kernel, values).is_none() {
                if self.made.len() == MOST_PIPELINES {
                    self.made.remove(0);
                }
                self.made.push((kernel.name, values.clone(), pipeline.clone()));
            }
        }
        pipelines.try_into().map_err(|_| missing())
    }

    fn find_or_make(
        &self,
        device: &Device,
        cache: Option<&PipelineCache>,
        wanted: &[(&'static Kernel, Values)],
    ) -> Vec<Result<Pipeline>> {
        let find_or_make = |kernel: &'static Kernel, values: &Values| match self.find(kernel, values) {
            Some(made) => Ok(made.clone()),
            None => Pipeline::new(device, kernel, values, cache),
        };
        if wanted.iter().all(|(kernel, values)| self.find(kernel, values).is_some()) {
            return wanted.iter().map(|(kernel, values)| find_or_make(kernel, values)).collect();
        }
        // Two stages may have one pipeline: it is made for the first of them.
        let first =
            |i: usize| wanted.iter().position(|w| w.0.name == wanted[i].0.name && w.1 == wanted[i].1).unwrap_or(i);
        std::thread::scope(|scope| {
            let threads: Vec<_> = wanted
                .iter()
                .enumerate()
                .map(|(i, (kernel, values))| (first(i) == i).then(|| scope.spawn(move || find_or_make(kernel, values))))
                .collect();
            let mut made: Vec<Result<Pipeline>> = Vec::with_capacity(threads.len());
            for (i, thread) in threads.into_iter().enumerate() {
                made.push(match thread.map(std::thread::ScopedJoinHandle::join) {
                    Some(Ok(pipeline)) => pipeline,
                    Some(Err(panic)) => std::panic::resume_unwind(panic),
                    // An error of the first is returned before this one.
                    None => made[first(i)].as_ref().map(Pipeline::clone).map_err(|_| missing()),
                });
            }
            made
        })
    }
}

fn missing() -> Error {
    Error::Vulkan { call: "vkCreateComputePipelines", result: "a pipeline is missing".into() }
}
