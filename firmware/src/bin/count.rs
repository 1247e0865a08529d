//! Instructions of pieces of planning, by grid and by number of sensors.
#![no_std]
#![no_main]

use core::hint::black_box;

use cortex_m as _;
use cortex_m_rt::entry;
use defmt_semihosting as _;
use quietpath_firmware::{Counter, finish};
use quietpath_flight::Error;
use quietpath_flight::yardstick::{
    INTERVALS, METRICS, Memory, SENSORS, Scratch, begin, descend, differentiate, evaluate, problem, replan, straight,
};
use static_cell::ConstStaticCell;

static MEMORY: ConstStaticCell<Memory> = ConstStaticCell::new(Memory::new());

#[entry]
fn main() -> ! {
    let memory = MEMORY.take();
    let mut counter = Counter::start();
    for intervals in INTERVALS {
        for sensors in SENSORS {
            if let Err(error) = measure(intervals, sensors, memory, &mut counter) {
                defmt::println!("error {}", error);
                finish(false);
            }
        }
    }
    finish(true)
}

fn measure(intervals: usize, sensors: usize, memory: &mut Memory, counter: &mut Counter) -> Result<(), Error> {
    let print = |what: &str, instructions: u64| {
        defmt::println!("count {=usize} {=usize} {=u64} {=str}", intervals, sensors, instructions, what);
    };
    let mut scratch = Scratch::default();
    for (metric, detector, name) in METRICS {
        let posed = problem(intervals, sensors, metric, detector)?;
        let path = straight(&posed)?;
        counter.lap();
        black_box(evaluate(&posed, &path, &mut scratch));
        print(name, counter.lap() / intervals as u64);
    }
    let (metric, detector, _) = METRICS[0];
    let posed = problem(intervals, sensors, metric, detector)?;
    let path = straight(&posed)?;
    let mut by = path.clone();
    counter.lap();
    black_box(differentiate(&posed, &path, &mut by, &mut scratch));
    print("gradient", counter.lap());
    let steps = black_box(descend(&posed, memory)?);
    print("one iteration, with its projection", counter.lap());
    defmt::println!("steps {=usize} {=usize} {=usize}", intervals, sensors, steps);
    let mut flight = begin(&posed)?;
    counter.lap();
    replan(&posed, &mut flight, memory)?;
    print("cold plan", counter.lap());
    replan(&posed, &mut flight, memory)?;
    print("warm replan", counter.lap());
    Ok(())
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    finish(false)
}
