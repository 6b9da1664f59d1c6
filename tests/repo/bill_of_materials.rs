//! Prints the bill of materials of the program as a CycloneDX document.

#[allow(dead_code)]
mod materials;
#[allow(dead_code)]
mod source;

fn main() {
    println!("{:#}", materials::bill(&materials::materials()));
}
