//! The arrays that a batch lends to Python: allocated once as numpy arrays, written by Rust between
//! calls, and handed out as read-only views.

use innerattn_env::batch::StepBuffers;
use innerattn_env::reward::NUM_COMPONENTS;
use numpy::{Element, Ix1, Ix2, Ix3, PyArray, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// An array that only this module writes.
pub struct Lent<T, D> {
    /// Of an array of its own, which is this view's base: numpy resizes no view.
    view: Py<PyArray<T, D>>,
    start: *mut T,
    length: usize,
}

// SAFETY: the pointer leads into the array that the view keeps alive; it is followed only through
// `&mut self`, so never from two threads at once.
unsafe impl<T: Send, D> Send for Lent<T, D> {}
// SAFETY: `&self` gives out nothing but the array object, which Python guards itself.
unsafe impl<T: Sync, D> Sync for Lent<T, D> {}

impl<T: Element, D: numpy::ndarray::Dimension> Lent<T, D> {
    /// An array of zeros of this shape.
    ///
    /// # Errors
    /// Python's `MemoryError` where there is not that much.
    pub fn zeros<S: numpy::ndarray::IntoDimension<Dim = D>>(py: Python, shape: S) -> PyResult<Self> {
        let shape = PyTuple::new(py, shape.into_dimension().slice())?;
        let array = py.import("numpy")?.call_method1("zeros", (shape, T::get_dtype(py)))?;
        let array = array.cast_into::<PyArray<T, D>>().map_err(PyErr::from)?;
        let (start, length) = (array.data(), array.len());
        array.getattr("flags")?.setattr("writeable", false)?;
        let view = array.call_method0("view")?.cast_into::<PyArray<T, D>>().map_err(PyErr::from)?;
        Ok(Self { view: view.unbind(), start, length })
    }

    /// The array, for Python.
    pub fn lend(&self, py: Python) -> Py<PyArray<T, D>> {
        self.view.clone_ref(py)
    }

    /// The array's memory, C order.
    pub fn memory(&mut self) -> &mut [T] {
        // SAFETY: `start` and `length` are those of the contiguous array kept alive by `self`. Python is
        // given read-only views of it, which numpy neither resizes nor makes writeable, and looks at
        // them only while no call is under way.
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
