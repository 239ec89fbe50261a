//! Worlds for a page: functions with plain numbers, for WebAssembly. The page writes text and numbers into
//! memory that it asks for here, and reads answers there. It knows no rule of the worlds itself.
//!
//! Nobody else calls these functions, on one thread.

mod place;

use std::cell::RefCell;

use innerattn_env::error::Error;
use innerattn_env::rules::Rules;
use place::{Place, Quantity};

#[derive(Default)]
struct Memory {
    /// Text from the page, or what was wrong.
    text: Vec<u8>,
    /// Numbers from the page, or for it.
    numbers: Vec<f64>,
    places: Vec<Option<Place>>,
}

thread_local! {
    static MEMORY: RefCell<Memory> = RefCell::default();
}

const REFUSED: i32 = -1;

/// Calls `act` with a world and the numbers; what it refuses becomes the text, and [`REFUSED`].
fn with(world: usize, act: impl FnOnce(&mut Place, &mut Vec<f64>) -> Result<i32, Error>) -> i32 {
    MEMORY.with_borrow_mut(|memory| {
        let Some(Some(place)) = memory.places.get_mut(world) else {
            memory.text = b"no such world".to_vec();
            return REFUSED;
        };
        act(place, &mut memory.numbers).unwrap_or_else(|error| {
            memory.text = error.to_string().into_bytes();
            REFUSED
        })
    })
}

/// Memory for a text of so many bytes.
#[unsafe(no_mangle)]
pub extern "C" fn text(length: usize) -> *mut u8 {
    MEMORY.with_borrow_mut(|memory| {
        memory.text.clear();
        memory.text.resize(length, 0);
        memory.text.as_mut_ptr()
    })
}

/// Where the text is.
#[unsafe(no_mangle)]
pub extern "C" fn text_place() -> *const u8 {
    MEMORY.with_borrow(|memory| memory.text.as_ptr())
}

/// Bytes of the text.
#[unsafe(no_mangle)]
pub extern "C" fn text_length() -> usize {
    MEMORY.with_borrow(|memory| memory.text.len())
}

/// Memory for so many numbers.
#[unsafe(no_mangle)]
pub extern "C" fn numbers(count: usize) -> *mut f64 {
    MEMORY.with_borrow_mut(|memory| {
        memory.numbers.clear();
        memory.numbers.resize(count, 0.0);
        memory.numbers.as_mut_ptr()
    })
}

/// Where the numbers are.
#[unsafe(no_mangle)]
pub extern "C" fn numbers_place() -> *const f64 {
    MEMORY.with_borrow(|memory| memory.numbers.as_ptr())
}

/// Makes a world of the scenario whose JSON is the text, at the start of its episode 0. Gives its number, or
/// [`REFUSED`] with a text.
#[unsafe(no_mangle)]
pub extern "C" fn open(seed: u64) -> i32 {
    MEMORY.with_borrow_mut(|memory| {
        let json = String::from_utf8_lossy(&memory.text);
        match Rules::from_json(&json).and_then(|rules| Place::new(rules, seed)) {
            Ok(place) => {
                memory.places.push(Some(place));
                memory.places.len() as i32 - 1
            }
            Err(error) => {
                memory.text = error.to_string().into_bytes();
                REFUSED
            }
        }
    })
}

/// Frees a world.
#[unsafe(no_mangle)]
pub extern "C" fn close(world: usize) {
    MEMORY.with_borrow_mut(|memory| {
        if let Some(place) = memory.places.get_mut(world) {
            *place = None;
        }
    });
}

/// Begins the next episode.
#[unsafe(no_mangle)]
pub extern "C" fn restart(world: usize) -> i32 {
    with(world, |place, _| Ok(place.restart(None)))
}

/// Begins episode 0 of another seed.
#[unsafe(no_mangle)]
pub extern "C" fn restart_with(world: usize, seed: u64) -> i32 {
    with(world, |place, _| Ok(place.restart(Some(seed))))
}

/// Does a control step with the numbers as actions. Gives 1 if the episode is over, and the next has begun.
#[unsafe(no_mangle)]
pub extern "C" fn step(world: usize) -> i32 {
    with(world, |place, actions| place.step(actions))
}

/// Puts the numbers in place of a quantity.
#[unsafe(no_mangle)]
pub extern "C" fn put(world: usize, quantity: usize) -> i32 {
    with(world, |place, values| place.put(Quantity::of(quantity)?, values))
}

/// Writes a quantity into the numbers; gives how many there are.
#[unsafe(no_mangle)]
pub extern "C" fn take(world: usize, quantity: usize) -> i32 {
    with(world, |place, values| {
        values.clear();
        place.take(Quantity::of(quantity)?, values)?;
        Ok(values.len() as i32)
    })
}
