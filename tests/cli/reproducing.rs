//! `punctual reproduce`: its refusals. (Its findings require an optimised build: see tests/interop.)

use crate::workshop::Workshop;

#[test]
fn a_guide_that_is_not_there_is_named() {
    let workshop = Workshop::new();
    let done = workshop.punctual(["reproduce", "--guide", "nowhere"]);
    done.fails_like(2, "cannot read nowhere/guide.md: ", &[]);
    workshop.write("guide.md", "<!-- table lunch -->\n<!-- end -->\n");
    workshop
        .punctual(["reproduce", "--guide", "."])
        .fails(2, "./guide.md: lunch: is no table of the guide, must be discretisation, step_size or always");
}
