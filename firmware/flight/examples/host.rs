//! The flight on the host, printed as the image `plan` prints it.

use quietpath_flight::{Memory, begin, bits, fly, replan};

fn main() -> Result<(), String> {
    let mut memory = Box::new(Memory::new());
    let mut flight = begin().map_err(|error| error.to_string())?;
    for number in 0.. {
        let step = replan(&mut flight, &mut memory).map_err(|error| error.to_string())?;
        let outcome = &step.outcome;
        println!(
            "plan {number} objective {:08x} iterations {} refinements {} factorizations {} evaluations {} projection_steps {}",
            outcome.objective.to_bits(),
            outcome.iterations,
            outcome.refinements,
            outcome.factorizations,
            outcome.evaluations,
            outcome.projection_steps
        );
        for (node, [east, north]) in bits(&flight).enumerate() {
            println!("node {node} {east:08x} {north:08x}");
        }
        if !fly(&mut flight) {
            break;
        }
    }
    Ok(())
}
