//! What runs on all processors: of every item what a closure makes of it, in the items' order, however many threads there are.
//!
//! Rayon's own adaptors are compiled anew for each closure, some two thousand lines of the compiler's code each time: they were a sixth of the
//! library's. Here its loop is compiled once. An item costs two locks: what is smaller is asked of Rayon itself.

use std::sync::Mutex;

use rayon::iter::{IntoParallelIterator, ParallelIterator};

/// Items of which each is a task of its own.
pub(crate) trait InParallel: IntoIterator + Sized {
    /// What follows is done for all items at once.
    fn in_parallel(self) -> Tasks<Self::Item> {
        Tasks(self.into_iter().collect())
    }
}

impl<I: IntoIterator> InParallel for I {}

/// See [`InParallel::in_parallel`]; nothing is done before a result is asked for, then all of it.
pub(crate) struct Tasks<T>(Vec<T>);

impl<T: Send> Tasks<T> {
    pub(crate) fn map<R: Send>(self, of: impl Fn(T) -> R + Sync) -> std::vec::IntoIter<R> {
        self.done(of).into_iter()
    }

    pub(crate) fn filter_map<R: Send>(self, of: impl Fn(T) -> Option<R> + Sync) -> impl Iterator<Item = R> {
        self.done(of).into_iter().flatten()
    }

    pub(crate) fn flat_map<R: IntoIterator<Item: Send>>(
        self,
        of: impl Fn(T) -> R + Sync,
    ) -> impl Iterator<Item = R::Item> {
        self.done(|item| of(item).into_iter().collect::<Vec<_>>()).into_iter().flatten()
    }

    pub(crate) fn for_each(self, of: impl Fn(T) + Sync) {
        self.done(of);
    }

    /// The first error in the items' order; the others are done all the same.
    pub(crate) fn try_for_each<E: Send>(self, of: impl Fn(T) -> Result<(), E> + Sync) -> Result<(), E> {
        self.done(of).into_iter().collect()
    }

    fn done<R: Send>(self, of: impl Fn(T) -> R + Sync) -> Vec<R> {
        let tasks: Vec<Task<T, R>> = self.0.into_iter().map(|item| Task(Mutex::new((Some(item), None)))).collect();
        every(tasks.len(), &|place| {
            // Not while the lock is held: what panics there would hide what it said.
            let item = tasks[place].with(|(item, _)| item.take());
            let found = item.map(&of);
            tasks[place].with(|(_, result)| *result = found);
        });
        tasks.into_iter().filter_map(Task::result).collect()
    }
}

/// An item until it is taken, then what was made of it.
struct Task<T, R>(Mutex<(Option<T>, Option<R>)>);

impl<T, R> Task<T, R> {
    fn with<O>(&self, change: impl FnOnce(&mut (Option<T>, Option<R>)) -> O) -> O {
        change(&mut self.0.lock().expect("nothing panics while a task is locked"))
    }

    fn result(self) -> Option<R> {
        self.0.into_inner().expect("nothing panics while a task is locked").1
    }
}

/// Two things at once.
pub(crate) fn join<A: Send, B: Send>(first: impl FnOnce() -> A + Send, second: impl FnOnce() -> B + Send) -> (A, B) {
    let (mut first, mut second) = (Some(first), Some(second));
    let (mut of_first, mut of_second) = (None, None);
    both(&mut || of_first = first.take().map(|f| f()), &mut || of_second = second.take().map(|f| f()));
    (of_first.expect("both are done"), of_second.expect("both are done"))
}

fn every(count: usize, task: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(task);
}

fn both(first: &mut (dyn FnMut() + Send), second: &mut (dyn FnMut() + Send)) {
    rayon::join(first, second);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_the_items_order_at_any_number_of_threads() {
        let expected: Vec<usize> = (0..1000).map(|i| i * i).collect();
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                assert_eq!((0..1000).in_parallel().map(|i| i * i).collect::<Vec<_>>(), expected);
                let even = (0..1000).in_parallel().filter_map(|i| (i % 2 == 0).then_some(i));
                assert_eq!(even.collect::<Vec<_>>(), (0..1000).step_by(2).collect::<Vec<_>>());
                let twice = (0..3).in_parallel().flat_map(|i| [i, i]);
                assert_eq!(twice.collect::<Vec<_>>(), [0, 0, 1, 1, 2, 2]);
                let mut numbers = vec![0; 1000];
                numbers.iter_mut().enumerate().in_parallel().for_each(|(i, number)| *number = i * i);
                assert_eq!(numbers, expected);
                // Tasks that have tasks.
                let inner = |i: usize| (0..i).in_parallel().map(|j| j).sum::<usize>();
                let sum: usize = (0..50).in_parallel().map(inner).sum();
                assert_eq!(sum, (0..50_usize).map(|i| i * (i.max(1) - 1) / 2).sum::<usize>());
            });
        }
    }

    #[test]
    fn the_first_error_in_the_items_order_is_the_answer() {
        let found = (0..100).in_parallel().try_for_each(|i| if i % 7 == 3 { Err(i) } else { Ok(()) });
        assert_eq!(found, Err(3));
        let all: Result<Vec<i32>, i32> = (0..100).in_parallel().map(|i| if i > 50 { Err(i) } else { Ok(i) }).collect();
        assert_eq!(all, Err(51));
    }

    #[test]
    fn two_things_are_done_and_a_panic_keeps_its_words() {
        let text = String::from("owned");
        assert_eq!(join(|| text.len(), || 7), (5, 7));
        let said = std::panic::catch_unwind(|| (0..3).in_parallel().for_each(|i| assert!(i != 1, "the second one")));
        let said = *said.unwrap_err().downcast::<&str>().unwrap();
        assert!(said.contains("the second one"), "{said}");
    }
}
