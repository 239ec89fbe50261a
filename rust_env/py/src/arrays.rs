//! The arrays that a batch lends to Python: allocated once as numpy arrays, written by Rust between
//! calls, and handed out as read-only views.

use innerattn_env::batch::StepBuffers;
use innerattn_env::reward::NUM_COMPONENTS;
use numpy::ndarray::{Dimension, IntoDimension};
use numpy::{Element, Ix1, Ix2, Ix3, PyArray, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// What a view names as its base: it keeps the array that owns the memory, and gives it to nobody.
#[pyclass(frozen, module = "innerattn._core")]
struct Memory(#[allow(dead_code)] Py<PyAny>);

/// An array that only this module writes.
pub struct Lent<T, D> {
    /// Its base is a `Memory`: numpy neither resizes such an array nor makes it writeable.
    view: Py<PyArray<T, D>>,
    start: *mut T,
    length: usize,
}

// SAFETY: the pointer leads into the memory that the view keeps alive; it is followed only through
// `&mut self`, so never from two threads at once.
unsafe impl<T: Send, D> Send for Lent<T, D> {}
// SAFETY: `&self` gives out nothing but the array object, which Python guards itself.
unsafe impl<T: Sync, D> Sync for Lent<T, D> {}

impl<T: Element, D: Dimension> Lent<T, D> {
    /// An array of zeros of this shape.
    ///
    /// # Errors
    /// Python's `MemoryError` where there is not that much.
    pub fn zeros<S: IntoDimension<Dim = D>>(py: Python, shape: S) -> PyResult<Self> {
        let shape = PyTuple::new(py, shape.into_dimension().slice())?;
        // NumPy asks the system for huge pages.
        let owner = py.import("numpy")?.call_method1("zeros", (shape, T::get_dtype(py)))?;
        let owner = owner.cast_into::<PyArray<T, D>>().map_err(PyErr::from)?;
        let (start, length) = (owner.data(), owner.len());
        let memory = Bound::new(py, Memory(owner.clone().into_any().unbind()))?.into_any();
        // SAFETY: `memory` keeps the array alive, and nothing else has it that could resize it.
        let view = unsafe { PyArray::borrow_from_array(&owner.readonly().as_array(), memory) };
        view.getattr("flags")?.setattr("writeable", false)?;
        Ok(Self { view: view.unbind(), start, length })
    }

    /// The array, for Python.
    pub fn lend(&self, py: Python) -> Py<PyArray<T, D>> {
        self.view.clone_ref(py)
    }

    /// The array's memory, C order.
    pub fn memory(&mut self) -> &mut [T] {
        // SAFETY: `start` and `length` are those of the contiguous array kept alive by `self`, which nothing
        // frees or moves before. Python cannot write it; a thread that reads it while another steps the batch
        // breaks the rule of `BatchEnv`, one thread at a time, and may see half a step.
        unsafe { std::slice::from_raw_parts_mut(self.start, self.length) }
    }
}

/// One set of everything that a step writes.
pub struct Arrays {
    pub obs: Lent<f32, Ix3>,
    pub final_obs: Lent<f32, Ix3>,
    pub reward: Lent<f32, Ix2>,
    pub components: Lent<f32, Ix3>,
    pub terminated: Lent<bool, Ix1>,
    pub truncated: Lent<bool, Ix1>,
}

impl Arrays {
    pub fn new(py: Python, envs: usize, robots: usize, width: usize) -> PyResult<Self> {
        Ok(Self {
            obs: Lent::zeros(py, [envs, robots, width])?,
            final_obs: Lent::zeros(py, [envs, robots, width])?,
            reward: Lent::zeros(py, [envs, robots])?,
            components: Lent::zeros(py, [envs, robots, NUM_COMPONENTS])?,
            terminated: Lent::zeros(py, [envs])?,
            truncated: Lent::zeros(py, [envs])?,
        })
    }

    pub fn buffers(&mut self) -> StepBuffers<'_> {
        StepBuffers {
            obs: self.obs.memory(),
            final_obs: self.final_obs.memory(),
            reward: self.reward.memory(),
            components: self.components.memory(),
            terminated: self.terminated.memory(),
            truncated: self.truncated.memory(),
        }
    }
}
