//! The arrays that steps write, as Python has them: lent as read-only views of memory that is written again
//! two steps later, or given for good, in memory that is written again once nobody has it any more.

use innerattn_env::batch::StepBuffers;
use innerattn_env::reward::NUM_COMPONENTS;
use numpy::ndarray::{ArrayView, Dimension, IntoDimension};
use numpy::{Element, Ix1, Ix2, Ix3, PyArray, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::ffi::Py_REFCNT;
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

/// Blocks of memory that are kept for arrays that are given.
const MOST_BLOCKS: usize = 4;
/// JAX takes memory that begins at a multiple of this without a copy, no other.
const ALIGNMENT: usize = 64;

/// Memory of an array that Python has, or that nobody has now.
struct Block<T> {
    /// Each array over it names it as its base, and slices of such arrays keep these alive.
    memory: Py<Memory>,
    start: *mut T,
}

// SAFETY: the pointer leads into the memory that `memory` keeps alive; it is followed only through
// `&mut Pool`, and only while no array is over it.
unsafe impl<T: Send> Send for Block<T> {}
// SAFETY: `&self` gives out nothing but arrays, which Python guards itself.
unsafe impl<T: Sync> Sync for Block<T> {}

impl<T: Element> Block<T> {
    fn new(py: Python, length: usize) -> PyResult<Self> {
        let bytes = length * size_of::<T>() + ALIGNMENT;
        let owner = py.import("numpy")?.call_method1("zeros", (bytes, "uint8"))?;
        let owner = owner.cast_into::<PyArray<u8, Ix1>>().map_err(PyErr::from)?;
        let offset = owner.data().align_offset(ALIGNMENT);
        // SAFETY: the owner is longer than the array by as much as the offset can be.
        let start = unsafe { owner.data().add(offset) }.cast::<T>();
        let memory = Py::new(py, Memory(owner.into_any().unbind()))?;
        Ok(Self { memory, start })
    }

    /// Whether no array is over it. Only an array, which there is none of, could lead to another one.
    fn is_free(&self, _py: Python) -> bool {
        // SAFETY: it is a live object, and `_py` shows that no other thread changes its count now.
        unsafe { Py_REFCNT(self.memory.as_ptr()) == 1 }
    }
}

/// Memory for one of the arrays of a step, each of which is its receiver's own.
pub struct Pool<T, D> {
    shape: D,
    length: usize,
    blocks: Vec<Block<T>>,
    current: usize,
}

impl<T: Element, D: Dimension> Pool<T, D> {
    fn new<S: IntoDimension<Dim = D>>(py: Python, shape: S) -> PyResult<Self> {
        let shape = shape.into_dimension();
        let length = shape.size();
        Ok(Self { shape, length, blocks: vec![Block::new(py, length)?], current: 0 })
    }

    /// Memory that nobody has; its numbers are whatever they were.
    fn free(&mut self, py: Python) -> PyResult<&mut [T]> {
        let free = self.blocks.iter().position(|block| block.is_free(py));
        self.current = if let Some(free) = free {
            free
        } else {
            let block = Block::new(py, self.length)?;
            if self.blocks.len() == MOST_BLOCKS {
                self.blocks.remove(0);
            }
            self.blocks.push(block);
            self.blocks.len() - 1
        };
        let start = self.blocks[self.current].start;
        // SAFETY: the block holds so many numbers, and no array is over it. Any bytes are a float; who had the
        // array of bools may have put other bytes there, so these become false first.
        unsafe {
            if size_of::<T>() == 1 {
                start.write_bytes(0, self.length);
            }
            Ok(std::slice::from_raw_parts_mut(start, self.length))
        }
    }

    /// An array over the memory that was written last.
    fn give(&self, py: Python) -> Py<PyArray<T, D>> {
        let Block { memory, start } = &self.blocks[self.current];
        // SAFETY: the memory is as long as the shape says, and the array keeps it alive.
        unsafe {
            let view = ArrayView::from_shape_ptr(self.shape.clone(), *start);
            PyArray::borrow_from_array(&view, memory.clone_ref(py).into_any().into_bound(py)).unbind()
        }
    }
}

/// One of the arrays of a step.
enum Output<T, D> {
    /// Two that take turns.
    Lent([Lent<T, D>; 2]),
    Given(Pool<T, D>),
}

impl<T: Element, D: Dimension> Output<T, D> {
    fn new<S: IntoDimension<Dim = D> + Copy>(py: Python, shape: S, given: bool) -> PyResult<Self> {
        Ok(if given {
            Self::Given(Pool::new(py, shape)?)
        } else {
            Self::Lent([Lent::zeros(py, shape)?, Lent::zeros(py, shape)?])
        })
    }

    fn memory(&mut self, py: Python, turn: usize) -> PyResult<&mut [T]> {
        match self {
            Self::Lent(pair) => Ok(pair[turn].memory()),
            Self::Given(pool) => pool.free(py),
        }
    }

    fn hand_out(&self, py: Python, turn: usize) -> Py<PyArray<T, D>> {
        match self {
            Self::Lent(pair) => pair[turn].lend(py),
            Self::Given(pool) => pool.give(py),
        }
    }
}

/// The arrays of a step as Python gets them: obs, reward, terminated, truncated, `final_obs`.
pub type Handed = (
    Py<PyArray<f32, Ix3>>,
    Py<PyArray<f32, Ix2>>,
    Py<PyArray<bool, Ix1>>,
    Py<PyArray<bool, Ix1>>,
    Py<PyArray<f32, Ix3>>,
);

/// Everything that a step writes.
pub struct Outputs {
    obs: Output<f32, Ix3>,
    final_obs: Output<f32, Ix3>,
    reward: Output<f32, Ix2>,
    terminated: Output<bool, Ix1>,
    truncated: Output<bool, Ix1>,
    /// Always lent: those of the last step stay while another one fails.
    components: [Lent<f32, Ix3>; 2],
    latest: usize,
}

impl Outputs {
    /// Arrays that are given for good, or lent until the step after next.
    pub fn new(py: Python, envs: usize, robots: usize, width: usize, given: bool) -> PyResult<Self> {
        let components = || Lent::zeros(py, [envs, robots, NUM_COMPONENTS]);
        Ok(Self {
            obs: Output::new(py, [envs, robots, width], given)?,
            final_obs: Output::new(py, [envs, robots, width], given)?,
            reward: Output::new(py, [envs, robots], given)?,
            terminated: Output::new(py, [envs], given)?,
            truncated: Output::new(py, [envs], given)?,
            components: [components()?, components()?],
            latest: 0,
        })
    }

    /// What the next step writes into.
    pub fn next(&mut self, py: Python) -> PyResult<StepBuffers<'_>> {
        let turn = 1 - self.latest;
        Ok(StepBuffers {
            obs: self.obs.memory(py, turn)?,
            final_obs: self.final_obs.memory(py, turn)?,
            reward: self.reward.memory(py, turn)?,
            components: self.components[turn].memory(),
            terminated: self.terminated.memory(py, turn)?,
            truncated: self.truncated.memory(py, turn)?,
        })
    }

    /// Takes what was written last as that of a step.
    pub fn stepped(&mut self) {
        self.latest = 1 - self.latest;
    }

    /// The arrays of the last step; those that are given are given once.
    pub fn hand_out(&self, py: Python) -> Handed {
        (
            self.obs.hand_out(py, self.latest),
            self.reward.hand_out(py, self.latest),
            self.terminated.hand_out(py, self.latest),
            self.truncated.hand_out(py, self.latest),
            self.final_obs.hand_out(py, self.latest),
        )
    }

    /// The components of the rewards of the last step.
    pub fn components(&self, py: Python) -> Py<PyArray<f32, Ix3>> {
        self.components[self.latest].lend(py)
    }
}
