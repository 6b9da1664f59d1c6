//! The library behind three functions that a page's script can call: room for a request, the answer's length, its place.
//!
//! ```text
//! at = room(bytes); write the request there (UTF-8); length = answer(); read so many bytes at answered()
//! ```
//!
//! A page has one thread, so one session and two buffers are enough. No pointer is ever dereferenced here: the script reads
//! and writes the module's memory itself.

use std::cell::RefCell;

use coilwright::task::explore::Session;

#[derive(Default)]
struct Desk {
    session: Session,
    request: Vec<u8>,
    answer: String,
}

thread_local! {
    static DESK: RefCell<Desk> = RefCell::default();
}

/// Makes room for a request; where it begins.
#[unsafe(no_mangle)]
pub extern "C" fn room(bytes: usize) -> *mut u8 {
    DESK.with_borrow_mut(|desk| {
        desk.request = vec![0; bytes];
        desk.request.as_mut_ptr()
    })
}

/// Answers the request that stands in the room; how many bytes the answer has.
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> usize {
    DESK.with_borrow_mut(|desk| {
        let request = String::from_utf8_lossy(&desk.request);
        desk.answer = desk.session.answer(&request);
        desk.answer.len()
    })
}

/// Where the answer begins.
#[unsafe(no_mangle)]
pub extern "C" fn answered() -> *const u8 {
    DESK.with_borrow(|desk| desk.answer.as_ptr())
}
