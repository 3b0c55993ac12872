//! Training over several processes: each takes its share of a step, and all take the mean of their gradients.

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::{Tensor, TensorData};
use softras::Result;
use std::rc::Rc;

/// The processes of a training.
pub trait Team {
    /// The number of this process, from 0.
    fn rank(&self) -> usize;
    /// How many there are.
    fn size(&self) -> usize;
    /// Puts the mean over all processes in the place of each value.
    fn average(&self, values: &mut [f32]);
    /// Ends the other processes, which would wait for this one for ever.
    fn abort(&self);

    /// Whether any of the processes says so.
    fn any(&self, own: bool) -> bool {
        let mut votes = [f32::from(u8::from(own))];
        self.average(&mut votes);
        votes[0] > 0.0
    }
}

/// A team of one.
#[derive(Debug)]
pub struct Alone;

impl Team for Alone {
    fn rank(&self) -> usize {
        0
    }

    fn size(&self) -> usize {
        1
    }

    fn average(&self, _: &mut [f32]) {}

    fn abort(&self) {}
}

/// What a launcher of MPI programs tells each of them by its environment: Open MPI's, others by PMI, and those by PMIx.
#[cfg(feature = "mpi")]
const LAUNCHED: [&str; 3] = ["OMPI_COMM_WORLD_SIZE", "PMI_RANK", "PMIX_RANK"];

/// The processes of this training: those that `mpirun` has started, where the crate is built with MPI, or this one alone.
///
/// # Errors
/// [`softras::Error::Fit`] where MPI cannot be started.
pub fn processes() -> Result<Rc<dyn Team>> {
    #[cfg(feature = "mpi")]
    if LAUNCHED.iter().any(|name| std::env::var_os(name).is_some()) {
        return match mpi::initialize() {
            Some(universe) => Ok(Rc::new(Mpi { universe })),
            None => super::fit_error("MPI cannot be started", "use `mpirun`, or build without the feature mpi"),
        };
    }
    Ok(Rc::new(Alone))
}

/// The processes that `mpirun` has started.
#[cfg(feature = "mpi")]
struct Mpi {
    universe: mpi::environment::Universe,
}

#[cfg(feature = "mpi")]
impl Team for Mpi {
    fn rank(&self) -> usize {
        mpi::traits::Communicator::rank(&self.universe.world()) as usize
    }

    fn size(&self) -> usize {
        mpi::traits::Communicator::size(&self.universe.world()) as usize
    }

    fn average(&self, values: &mut [f32]) {
        use mpi::traits::CommunicatorCollectives;
        let own = values.to_vec();
        self.universe.world().all_reduce_into(&own[..], values, mpi::collective::SystemOperation::sum());
        let share = 1.0 / self.size() as f32;
        values.iter_mut().for_each(|value| *value *= share);
    }

    fn abort(&self) {
        mpi::traits::Communicator::abort(&self.universe.world(), 1);
    }
}

/// The mean of the gradients of all processes.
pub fn average_gradients(gradients: GradientsParams, module: &impl Module, team: &dyn Team) -> GradientsParams {
    if team.size() == 1 {
        return gradients;
    }
    let mut average = Average { own: gradients, all: GradientsParams::new(), team };
    module.visit(&mut average);
    average.all
}

struct Average<'a> {
    own: GradientsParams,
    all: GradientsParams,
    team: &'a dyn Team,
}

impl ModuleVisitor for Average<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let Some(gradient) = self.own.remove::<D>(param.id) else { return };
        self.all.register::<D>(param.id, averaged(gradient, self.team));
    }
}

/// The module with the means over all processes of what is no weight: the batch norms' running means.
pub fn average_running<M: Module>(module: M, team: &dyn Team) -> M {
    if team.size() == 1 { module } else { module.map(&mut Means(team)) }
}

struct Means<'a>(&'a dyn Team);

impl ModuleMapper for Means<'_> {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        if param.is_require_grad() { param } else { param.map(|tensor| averaged(tensor, self.0)) }
    }
}

/// A tensor that cannot be read becomes NaN in all processes, so that all of them end with the same error.
fn averaged<const D: usize>(tensor: Tensor<D>, team: &dyn Team) -> Tensor<D> {
    let (shape, device) = (tensor.shape(), tensor.device());
    let count = shape.num_elements();
    let mut values = tensor.try_into_vec_as::<f32>().unwrap_or_else(|_| vec![f32::NAN; count]);
    team.average(&mut values);
    Tensor::from_data(TensorData::new(values, shape), &device)
}
