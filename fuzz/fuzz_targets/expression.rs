#![no_main]
//! Any text: a formula that can be evaluated or an error that can be shown, never a panic.

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    match coilwright::numeric::expression::Expression::parse(text) {
        Ok(expression) => {
            let _ = expression.evaluate(&vec![1.5; expression.variables().len()]);
        }
        Err(error) => {
            let _ = error.to_string();
        }
    }
});
