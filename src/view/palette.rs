/// A colour in sRGB.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rgb(pub(super) u8, pub(super) u8, pub(super) u8);

/// Colours of tasks, told apart by colour-blind people too; none is near the cross-task red.
const TASKS: [Rgb; 6] = [
    Rgb(0x2f, 0x6f, 0xc9),
    Rgb(0xe0, 0x8a, 0x1e),
    Rgb(0x1f, 0x9e, 0x89),
    Rgb(0x7b, 0x5e, 0xa7),
    Rgb(0x8a, 0x8d, 0x2b),
    Rgb(0x5b, 0x6b, 0x7c),
];

/// Cross-task edges that are certain.
pub(super) const CROSS_TASK: Rgb = Rgb(0xd1, 0x1a, 0x52);
/// Cross-task edges that are least certain.
pub(super) const CROSS_TASK_PALE: Rgb = Rgb(0xf4, 0xb3, 0xc4);
/// The planned route, and text.
pub(super) const INK: Rgb = Rgb(0x1b, 0x20, 0x2b);
/// Text that stands back.
pub(super) const GREY: Rgb = Rgb(0x6b, 0x72, 0x80);
/// The chosen final state.
pub(super) const STAR: Rgb = Rgb(0xff, 0xc9, 0x3c);

/// The colour of the task at this place in the order; colours repeat after six tasks.
pub(super) fn task(index: usize) -> Rgb {
    TASKS[index % TASKS.len()]
}

impl Rgb {
    /// `#rrggbb`.
    pub(super) fn hex(self) -> String {
        format!("#{:02x}{:02x}{:02x}", self.0, self.1, self.2)
    }

    /// A mixture: `share` 0 is this colour, 1 the other.
    pub(super) fn mixed(self, other: Self, share: f32) -> Self {
        let mix = |a: u8, b: u8| {
            (f32::from(a) + (f32::from(b) - f32::from(a)) * share.clamp(0.0, 1.0)).round() as u8
        };
        Self(
            mix(self.0, other.0),
            mix(self.1, other.1),
            mix(self.2, other.2),
        )
    }
}
