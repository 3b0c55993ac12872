//! The weights of a network by name, as SafeTensors lists them.

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param, ParamId};
use burn::tensor::{Device, Tensor, TensorData};
use safetensors::{Dtype, SafeTensors};

/// A weight: its name, its shape and its values.
#[derive(Clone, Debug)]
pub struct Weight {
    /// The names of the modules around it and its own, with dots between them.
    pub name: String,
    /// Its shape.
    pub shape: Vec<usize>,
    /// Its values, the last index fastest; empty where the tensor cannot be read.
    pub values: Vec<f32>,
}

/// All weights of a network in training, and the running means of its batch norms.
pub fn list(network: &impl Module) -> Vec<Weight> {
    let mut list = List::default();
    network.visit(&mut list);
    list.weights
}

#[derive(Default)]
struct List {
    path: Vec<String>,
    weights: Vec<Weight>,
}

impl ModuleVisitor for List {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.into());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let tensor = param.val();
        let (name, shape) = (self.path.join("."), tensor.dims().to_vec());
        self.weights.push(Weight { name, shape, values: tensor.try_into_vec_as().unwrap_or_default() });
    }
}

/// The network with its weights numbered by their order, which is how an optimiser knows them: so its state fits every network
/// of the same settings.
pub fn numbered<M: Module>(network: M) -> M {
    network.map(&mut Number(0))
}

struct Number(u64);

impl ModuleMapper for Number {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        self.0 += 1;
        let (_, tensor, mapper) = param.consume();
        Param::from_mapped_value(ParamId::from(self.0), tensor, mapper)
    }
}

/// Where weights come from.
pub trait Source {
    /// The values of a weight of that name and shape.
    fn values(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, String>;
}

impl Source for SafeTensors<'_> {
    fn values(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, String> {
        let view = self.tensor(name).map_err(|e| e.to_string())?;
        if (view.dtype(), view.shape()) != (Dtype::F32, shape) {
            let found = format!("{:?} of shape {:?}", view.dtype(), view.shape());
            return Err(format!("{name} is {found}, the network has F32 of shape {shape:?}"));
        }
        Ok(view.data().as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect())
    }
}

/// The network with the weights of a source.
pub fn load<M: Module>(network: M, source: &dyn Source, device: &Device) -> Result<M, String> {
    let mut load = Load { path: Vec::new(), source, device, wrong: None };
    let network = network.map(&mut load);
    load.wrong.map_or(Ok(network), Err)
}

struct Load<'a> {
    path: Vec<String>,
    source: &'a dyn Source,
    device: &'a Device,
    wrong: Option<String>,
}

impl Load<'_> {
    fn values(&self, shape: &[usize]) -> Result<Vec<f32>, String> {
        let name = self.path.join(".");
        let values = self.source.values(&name, shape)?;
        if values.iter().all(|x| x.is_finite()) { Ok(values) } else { Err(format!("{name} is not finite")) }
    }
}

impl ModuleMapper for Load<'_> {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.into());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let shape = param.lazy_shape();
        match self.values(&shape) {
            Ok(values) => {
                let (data, id) = (TensorData::new(values, shape), param.id);
                param.transform_for_load(Tensor::from_data(data, self.device), id)
            }
            Err(wrong) => {
                self.wrong.get_or_insert(wrong);
                param
            }
        }
    }
}
