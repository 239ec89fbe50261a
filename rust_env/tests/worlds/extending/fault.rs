use innerattn_env::fault::{Drive, Effect, Spec, either};

const WORN_MOTOR: Spec = Spec {
    name: "worn_motor",
    range: (0.0, 1.0),
    unit: "",
    healthy: 0.0,
    meaning: "share of force and speed that is lost",
    combine: either,
    effect: Effect::Drive(|drive, worn| {
        drive.force *= 1.0 - worn;
        drive.speed *= 1.0 - worn;
    }),
};

fn driven(worn: f32) -> Drive {
    let mut drive = Drive::default();
    if let Effect::Drive(change) = WORN_MOTOR.effect {
        change(&mut drive, worn);
    }
    drive
}

#[test]
fn a_worn_motor_loses_force_and_speed() {
    assert_eq!(driven(WORN_MOTOR.healthy), Drive::default());
    assert_eq!(driven(0.25), Drive { force: 0.75, speed: 0.75, turn: 0.0 });
    // Two such faults on one robot: each takes its share of what the other leaves.
    let both = (WORN_MOTOR.combine)(0.25, 0.5);
    assert_eq!(driven(both), Drive { force: 0.375, speed: 0.375, turn: 0.0 });
}
