//! Known answers: the XML of a small model of FMI 3.0.

#[path = "support/fmi3.rs"]
mod support;

use support::small3;

#[test]
fn small_model_gives_the_golden_file() {
    let xml = small3().to_xml().expect("valid");
    if std::env::var_os("PUNCTUAL_UPDATE_GOLDEN").is_some() {
        std::fs::write("tests/golden/small3.xml", &xml).expect("can be written");
    }
    assert_eq!(xml, std::fs::read_to_string("tests/golden/small3.xml").expect("can be read"));
}
