//! Panics in an export. They cannot be triggered from outside, so these tests cause them inside.

use super::super::fmi2::{self, CallbackFunctions, Environment};

use super::super::fmi2::{Component, Status, Text};
use super::super::logger::Logger;
use super::*;
use crate::configuration::Configuration;
use crate::product::Product;

/// Keeps messages in the `Vec<String>` that the environment points to.
extern "C" fn keep(
    environment: Environment,
    _instance: Text,
    status: Status,
    _category: Text,
    message: Text,
) {
    // SAFETY: `handle` passes such a vector, and nothing else refers to it during a call.
    let messages = unsafe { environment.cast::<Vec<String>>().as_mut() };
    // SAFETY: the logger passes a string.
    let message = unsafe { text(message) };
    messages.unwrap().push(format!("{} {}", status.0, message.unwrap()));
}

fn handle(messages: &mut Vec<String>) -> Handle {
    let configuration = Configuration::parse("kind = \"plant\"\nplant.model = \"unicycle\"").unwrap();
    let guid = Product::new(configuration.clone()).unwrap().guid;
    // SAFETY: the caller passes exactly the five fixed arguments. Calling a function with five fixed
    // arguments as a variadic one works on x86-64 and AArch64, though the language does not guarantee it.
    let logger = unsafe { std::mem::transmute::<*const (), fmi2::Logger>(keep as *const ()) };
    let callbacks = CallbackFunctions {
        logger: Some(logger),
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        environment: std::ptr::from_mut(messages).cast(),
    };
    Handle {
        instance: Instance::new(configuration, &guid).unwrap(),
        logger: Logger::of_fmi2(Some(&callbacks), c"instance".to_owned(), true),
        poisoned: false,
    }
}

/// A payload that cannot be dropped.
struct Bomb;

impl Drop for Bomb {
    fn drop(&mut self) {
        panic!("dropped");
    }
}

/// One test for everything, because the hook and the last message belong to the whole process.
#[test]
fn a_panic_becomes_an_error_and_poisons_the_instance() {
    install_panic_hook();
    let mut messages = Vec::new();
    let mut handle = handle(&mut messages);
    let component: Component = std::ptr::from_mut(&mut handle).cast();
    // SAFETY: the component is a handle that lives until the end of this function.
    let status: Status = unsafe { guarded(component, "fmi2DoStep", |_| panic!("100% wrong\nat line 2")) };
    assert_eq!(status, Status::ERROR);
    let mut ran = false;
    let body = |_: &mut Handle| {
        ran = true;
        Ok(Status::OK)
    };
    // SAFETY: as above.
    let again = unsafe { guarded(component, "fmi2GetReal", body) };
    assert_eq!((again, ran), (Status::ERROR, false), "a poisoned instance does nothing");
    assert!(handle.poisoned);
    drop(handle);

    assert_eq!(catch(|| 1), Ok(1));
    let bomb = catch(|| std::panic::panic_any(Bomb)).unwrap_err();
    assert!(bomb.starts_with("internal error, please report it: panicked at "), "{bomb}");
    // Other tests print their messages again.
    drop(std::panic::take_hook());

    assert_eq!(messages.len(), 2, "{messages:?}");
    let place = "3 fmi2DoStep: internal error, please report it: panicked at ";
    assert!(messages[0].starts_with(place), "{messages:?}");
    assert!(messages[0].ends_with(": 100? wrong at line 2"), "one line, without a conversion: {messages:?}");
    assert_eq!(messages[1], "3 fmi2GetReal: the instance failed before and can only be freed");
}

#[test]
fn null_is_an_error_and_runs_nothing() {
    // SAFETY: NULL is allowed.
    let status: Status = unsafe { guarded(std::ptr::null_mut(), "fmi2Reset", |_| panic!("ran")) };
    assert_eq!(status, Status::ERROR);
}

#[test]
fn slices_of_length_0_read_nothing_and_impossible_ones_are_refused() {
    let dangling = std::ptr::dangling_mut::<f64>();
    // SAFETY: length 0.
    assert_eq!(unsafe { slice("value", std::ptr::null::<f64>(), 0) }, Ok(&[][..]));
    // SAFETY: length 0.
    assert_eq!(unsafe { slice_mut("value", dangling, 0) }, Ok(&mut [][..]));
    // SAFETY: NULL is allowed.
    let null = unsafe { slice("value", std::ptr::null::<f64>(), 2) };
    assert_eq!(null, Err("value is NULL with 2 elements".to_owned()));
    // SAFETY: refused by its length before anything is read.
    let long = unsafe { slice("value", dangling.cast_const(), usize::MAX) };
    assert_eq!(long, Err(format!("value cannot have {} elements", usize::MAX)));
}

#[test]
fn text_survives_null_and_bytes_that_are_not_utf8() {
    // SAFETY: NULL is allowed.
    assert_eq!(unsafe { text(std::ptr::null()) }, None);
    // SAFETY: a string.
    assert_eq!(unsafe { text(c"a\xffb".as_ptr()) }, Some("a\u{fffd}b".to_owned()));
}
