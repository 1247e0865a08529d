//! The microcontrollers that the images are laid out for.

/// A microcontroller, and what stands in for it.
pub struct Part {
    /// Core and part.
    pub name: &'static str,
    /// QEMU's machine, and its processor.
    pub machine: &'static str,
    pub processor: &'static str,
    /// Cargo's profile, and the feature that chooses the part's memory.
    pub profile: &'static str,
    pub features: &'static str,
    /// The feature that chooses the same planner on the host.
    pub planner: &'static str,
    /// Whether the budget of instructions is this part's.
    pub is_timed: bool,
    /// Most bytes of flash and of RAM that the built-in flight may take.
    pub flash_max: u64,
    pub ram_max: u64,
}

const KIB: u64 = 1024;

/// Compiled for speed, and for size.
pub const PARTS: [Part; 2] = [
    Part {
        name: "Cortex-M7, STM32H743",
        machine: "mps2-an500",
        processor: "cortex-m7",
        profile: "release",
        features: "",
        planner: "",
        is_timed: true,
        flash_max: 2048 * KIB,
        ram_max: 72 * KIB,
    },
    Part {
        name: "Cortex-M4F, STM32F405",
        machine: "mps2-an386",
        processor: "cortex-m4",
        profile: "small",
        features: "m4f",
        planner: "first-order",
        is_timed: false,
        flash_max: 128 * KIB,
        ram_max: 64 * KIB,
    },
];
