//! The door for arrays: whatever Python gives becomes numbers of our own, read once, or a `TypeError` or
//! `ValueError` that names the argument and what it must be. What is checked afterwards is the copy, so
//! that no other thread can change it.

use numpy::{Element, PyArrayDyn, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyException, PyMemoryError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

static MASKED: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
static AS_ARRAY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();

/// What an argument must be.
pub struct Door<'a> {
    /// Name of the argument.
    pub name: &'static str,
    /// Letters for the kinds of numbers that it may hold, and sizes of their items, bytes.
    kinds: &'static str,
    sizes: &'static [usize],
    /// The same in words.
    what: &'static str,
    shape: &'a [usize],
}

impl<'a> Door<'a> {
    pub fn integers(name: &'static str, shape: &'a [usize]) -> Self {
        Self { name, kinds: "iu", sizes: &[1, 2, 4, 8], what: "integers", shape }
    }

    pub fn floats(name: &'static str, shape: &'a [usize]) -> Self {
        Self { name, kinds: "f", sizes: &[2, 4, 8], what: "floats of 16, 32 or 64 bits", shape }
    }

    pub fn numbers(name: &'static str, shape: &'a [usize]) -> Self {
        let what = "integers, or floats of 16, 32 or 64 bits,";
        Self { name, kinds: "iuf", sizes: &[1, 2, 4, 8], what, shape }
    }

    pub fn flags(name: &'static str, shape: &'a [usize]) -> Self {
        Self { name, kinds: "b", sizes: &[1], what: "bool", shape }
    }

    /// What is given as int64, C order.
    pub fn read_i64(&self, given: &Bound<PyAny>, into: &mut Vec<i64>) -> PyResult<()> {
        if self.copied(given, into)? {
            return Ok(());
        }
        // Numbers past int64 wrap to negative ones, which the range check refuses.
        self.cast::<i64>(&self.checked(given)?, "int64", into)
    }

    /// What is given as float32, C order; what is too large for that becomes infinite.
    pub fn read_f32(&self, given: &Bound<PyAny>, into: &mut Vec<f32>) -> PyResult<()> {
        if self.copied(given, into)? {
            return Ok(());
        }
        let mut wide = Vec::new();
        self.cast::<f64>(&self.checked(given)?, "float64", &mut wide)?;
        reserve(into, wide.len())?;
        into.extend(wide.iter().map(|number| *number as f32));
        Ok(())
    }

    /// What is given as float64, C order.
    pub fn read_f64(&self, given: &Bound<PyAny>, into: &mut Vec<f64>) -> PyResult<()> {
        if self.copied(given, into)? {
            return Ok(());
        }
        self.cast::<f64>(&self.checked(given)?, "float64", into)
    }

    /// What is given as truth values; any byte but 0 is true, as it is to numpy.
    pub fn read_flags(&self, given: &Bound<PyAny>) -> PyResult<Vec<bool>> {
        let mut bytes = Vec::new();
        let array = self.checked(given)?.call_method1("view", ("uint8",))?;
        self.cast::<u8>(&array, "uint8", &mut bytes)?;
        Ok(bytes.iter().map(|byte| *byte != 0).collect())
    }

    /// Copies a plain array that is as it must be already. Returns whether it is one.
    fn copied<T: Element + Copy>(&self, given: &Bound<PyAny>, into: &mut Vec<T>) -> PyResult<bool> {
        if !given.is_exact_instance_of::<PyUntypedArray>() {
            return Ok(false);
        }
        let Ok(array) = given.cast::<PyArrayDyn<T>>() else { return Ok(false) };
        if array.shape() != self.shape || !array.is_c_contiguous() || !array.is_aligned() {
            return Ok(false);
        }
        into.clear();
        reserve(into, array.len())?;
        let Ok(array) = array.try_readonly() else { return Ok(false) };
        into.extend_from_slice(array.as_slice().map_err(|_| self.wrong_shape(given))?);
        Ok(true)
    }

    /// What is given as an array of the right kind and shape, whatever its layout.
    fn checked<'py>(&self, given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let py = given.py();
        let masked = MASKED
            .get_or_try_init(py, || py.import("numpy.ma")?.getattr("MaskedArray").map(Bound::unbind))?;
        if given.is_instance(masked.bind(py))? {
            let text = "is a masked array, whose mask would be lost: fill it; it";
            return Err(PyTypeError::new_err(format!("{} {text} {}", self.name, self.expected())));
        }
        let as_array =
            AS_ARRAY.get_or_try_init(py, || py.import("numpy")?.getattr("asarray").map(Bound::unbind))?;
        let array = as_array.bind(py).call1((given,)).map_err(|error| self.unreadable(py, error))?;
        let untyped = array.cast::<PyUntypedArray>()?;
        let dtype = untyped.dtype();
        let kind: String = dtype.getattr("kind")?.extract()?;
        let size: usize = dtype.getattr("itemsize")?.extract()?;
        if !self.kinds.contains(&kind) || !self.sizes.contains(&size) {
            let text = format!("{} has dtype {dtype}: {}", self.name, self.expected());
            return Err(PyTypeError::new_err(text));
        }
        if untyped.shape() != self.shape {
            return Err(self.wrong_shape(&array));
        }
        Ok(array)
    }

    /// A plain copy of an array that was found right.
    fn cast<T: Element + Copy>(&self, array: &Bound<PyAny>, dtype: &str, into: &mut Vec<T>) -> PyResult<()> {
        let plain = array.call_method1("astype", (dtype, "C", "unsafe", false, true))?;
        into.clear();
        if self.copied(&plain, into)? { Ok(()) } else { Err(self.wrong_shape(&plain)) }
    }

    fn unreadable(&self, py: Python, error: PyErr) -> PyErr {
        if error.is_instance_of::<PyMemoryError>(py) || !error.is_instance_of::<PyException>(py) {
            return error;
        }
        let text = error.value(py).to_string();
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        PyTypeError::new_err(format!(
            "{} cannot be read as an array ({text}): {}",
            self.name,
            self.expected()
        ))
    }

    fn expected(&self) -> String {
        format!("must be {} of shape {}", self.what, in_words(self.shape))
    }

    fn wrong_shape(&self, array: &Bound<PyAny>) -> PyErr {
        let found = array.cast::<PyUntypedArray>().map(|array| in_words(array.shape()));
        let found = found.unwrap_or_default();
        PyValueError::new_err(format!("{} has shape {found}: must be {}", self.name, in_words(self.shape)))
    }
}

/// A shape as Python writes it.
fn in_words(shape: &[usize]) -> String {
    let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
    if let [size] = &sizes[..] { format!("({size},)") } else { format!("({})", sizes.join(", ")) }
}

/// Room for so many more numbers, or Python's `MemoryError`.
pub fn reserve<T>(numbers: &mut Vec<T>, count: usize) -> PyResult<()> {
    let bytes = count.saturating_mul(size_of::<T>());
    let refused = |_| PyMemoryError::new_err(format!("{bytes} bytes are not to be had"));
    numbers.try_reserve_exact(count).map_err(refused)
}

/// So many zeros, or Python's `MemoryError`.
pub fn zeros<T: Clone + Default>(count: usize) -> PyResult<Vec<T>> {
    let mut numbers = Vec::new();
    reserve(&mut numbers, count)?;
    numbers.resize(count, T::default());
    Ok(numbers)
}

/// The numbers, of which there are so many, or Python's `MemoryError`.
pub fn gather<T>(count: usize, numbers: impl Iterator<Item = T>) -> PyResult<Vec<T>> {
    let mut gathered = Vec::new();
    reserve(&mut gathered, count)?;
    gathered.extend(numbers);
    Ok(gathered)
}

/// Asks the system for memory and gives it back, before it is taken in pieces that cannot be refused.
///
/// # Errors
/// Python's `MemoryError`.
pub fn probe(py: Python, bytes: usize) -> PyResult<()> {
    py.import("numpy")?.call_method1("empty", (bytes, "uint8")).map(|_| ())
}
