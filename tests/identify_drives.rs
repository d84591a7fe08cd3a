//! The steering actuator from ordinary drives: dead time, lag, gain and offset with intervals that hold the truth.

use rfl_mpc::control::{Controller, ControllerParameters, PredictionModel};
use rfl_mpc::log::{DriveLog, SteeringLog};
use rfl_mpc::nominal::{
    Actuator, Between, DrivesError, Estimate, IdentifiedSteering, SteeringDrive,
    identify_by_yaw_rate_from_drives, identify_from_drives,
};
use rfl_mpc::numerics::Random;
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::simulate::ClosedLoop;
use rfl_mpc::vehicle::{CarParameters, Effects, SteeringChain, SteeringState, builtin};
use std::sync::Arc;

const TS: f64 = 0.02;

/// A chain without limits.
fn chain(dead_time: f64, lag: f64) -> SteeringChain {
    SteeringChain {
        dead_time,
        lag,
        rate_limit: f64::MAX,
        angle_limit: 1.0,
        backlash: 0.0,
        gain: 1.0,
        offset: 0.0,
    }
}

/// Commands as of a drive: bends that come and go, and a controller's small corrections.
fn commands(rows: usize, seed: u64, busy: f64) -> Vec<f64> {
    let mut random = Random::new(seed);
    let (mut bend, mut left, mut held, mut fine) = (0.0, 0_usize, 0.0, 0.0);
    (0..rows)
        .map(|_| {
            if left == 0 {
                left = 60 + (140.0 * random.uniform()) as usize;
                bend = 0.12 * (random.uniform() - 0.5);
            }
            left -= 1;
            held += 0.04 * (bend - held);
            fine = 0.9 * fine + busy * 0.01 * (random.uniform() - 0.5);
            held + fine
        })
        .collect()
}

/// What the chain makes of commands.
fn measured(
    chain: &SteeringChain,
    time: &[f64],
    commands: &[f64],
    mut noise: impl FnMut() -> f64,
) -> Vec<f64> {
    let mut state = SteeringState::at_rest(chain, commands[0]);
    let mut now = time[0];
    time.iter()
        .zip(commands)
        .map(|(&time, &command)| {
            state.advance(chain, now, time - now);
            now = time;
            let angle = state.measured();
            state.command(chain, time, command);
            angle + noise()
        })
        .collect()
}

fn even(rows: usize) -> Vec<f64> {
    (0..rows).map(|k| TS * k as f64).collect()
}

fn drive_of(time: Vec<f64>, steer_cmd: Vec<f64>, response: Vec<f64>) -> SteeringDrive {
    SteeringDrive { name: "synthetic".into(), time, steer_cmd, response, ..SteeringDrive::default() }
}

/// A Gaussian's number, nearly: twelve uniform ones.
fn gauss(random: &mut Random) -> f64 {
    (0..12).map(|_| random.uniform()).sum::<f64>() - 6.0
}

/// Whether an interval holds the truth, by no more than a share of a millisecond beside it.
fn holds(estimate: &Estimate, truth: f64) -> bool {
    (estimate.low - 2e-4..=estimate.high + 2e-4).contains(&truth)
}

/// A synthetic drive of a chain.
fn synthetic(chain: &SteeringChain, rows: usize, noise: f64, seed: u64) -> SteeringDrive {
    let (time, command) = (even(rows), commands(rows, seed, 1.0));
    let mut random = Random::new(seed + 1000);
    let angle = measured(chain, &time, &command, || noise * gauss(&mut random));
    drive_of(time, command, angle)
}

fn found(drive: SteeringDrive) -> IdentifiedSteering {
    identify_from_drives(&[drive]).unwrap()
}

#[test]
fn dead_time_and_lag_are_found_whatever_they_are() {
    for (dead_time, lag) in
        [(0.06, 0.1), (0.0, 0.1), (0.0, 0.0), (0.05, 0.03), (0.113, 0.15), (0.3, 0.2), (0.047, 0.0)]
    {
        let exact = found(synthetic(&chain(dead_time, lag), 1000, 0.0, 7));
        assert!(holds(&exact.dead_time, dead_time) && holds(&exact.lag, lag), "{dead_time} {lag}: {exact:?}");
        assert!(exact.excited() && exact.left_out.is_empty(), "{dead_time} {lag}: {exact:?}");
        if lag > 0.0 {
            let error = (exact.dead_time.value - dead_time).abs().max((exact.lag.value - lag).abs());
            assert!(error < 1e-4, "{dead_time} {lag}: {exact:?}");
        } else {
            // Between two samples a pure dead time does not show: its interval is a step wide.
            assert!(exact.dead_time.high - exact.dead_time.low > 0.5 * TS, "{exact:?}");
        }
        let noisy = found(synthetic(&chain(dead_time, lag), 1000, 1e-3, 7));
        let error = (noisy.delay.value - dead_time - lag).abs();
        assert!(noisy.excited() && error < 0.5 * TS, "{dead_time} {lag}: {noisy:?}");
    }
}

#[test]
fn intervals_hold_the_truth_in_nine_of_ten_cases() {
    // White noise, and noise that lasts for ten rows.
    for colour in [0.0_f64, 0.9] {
        let mut held = [0; 5];
        for seed in 0..40 {
            let mut drive = synthetic(&chain(0.06, 0.1), 1200, 0.0, seed);
            let (mut random, mut noise) = (Random::new(seed + 99), 0.0);
            for angle in &mut drive.response {
                noise = colour * noise + (1.0 - colour * colour).sqrt() * 1e-3 * gauss(&mut random);
                *angle = 1.02 * *angle + 0.003 + noise;
            }
            let found = found(drive);
            let truths = [
                (found.dead_time, 0.06),
                (found.lag, 0.1),
                (found.delay, 0.16),
                (found.gain, 1.02),
                (found.offset, 0.003),
            ];
            for (held, (estimate, truth)) in held.iter_mut().zip(truths) {
                *held += usize::from(estimate.low <= truth && truth <= estimate.high);
            }
        }
        // Eight of ten over all numbers; of one of them, forty cases of nine in ten are below 28 once in ten thousand.
        assert!(held.iter().sum::<usize>() >= 160, "colour {colour}: {held:?} of 40");
        assert!(held.iter().all(|held| *held >= 28), "colour {colour}: {held:?} of 40");
    }
}

#[test]
fn wrong_rows_gaps_and_an_uneven_clock_do_no_harm() {
    let mut drive = synthetic(&chain(0.06, 0.1), 1500, 1e-3, 3);
    (drive.response[500], drive.response[900], drive.response[901]) = (10.0, -0.2, 0.3);
    (drive.response[1200], drive.response[1300]) = (f64::NAN, 1e308);
    (drive.steer_cmd[700], drive.steer_cmd[800], drive.steer_cmd[1000]) = (1e300, 5.0, f64::NAN);
    let robust = found(drive);
    assert!((robust.delay.value - 0.16).abs() < 3e-3, "{robust:?}");
    let rows: Vec<u32> = robust.left_out.iter().map(|one| one.row).collect();
    assert!([500, 700, 800, 900, 901, 1300].iter().all(|row| rows.contains(row)), "{rows:?}");

    // Stamps that are true and uneven, and two gaps.
    let (mut random, steer_cmd) = (Random::new(9), commands(1500, 6, 1.0));
    let time: Vec<f64> = (0..1500).map(|k| TS * (f64::from(k) + 0.6 * (random.uniform() - 0.5))).collect();
    let response = measured(&chain(0.06, 0.1), &time, &steer_cmd, || 0.0);
    let kept: Vec<usize> = (0..1500).filter(|k| !(400..520).contains(k) && !(900..960).contains(k)).collect();
    let part = |column: &[f64]| kept.iter().map(|&row| column[row]).collect::<Vec<f64>>();
    let uneven = found(drive_of(part(&time), part(&steer_cmd), part(&response)));
    assert!((uneven.dead_time.value - 0.06).abs() < 1e-4, "{uneven:?}");
    assert!((uneven.lag.value - 0.1).abs() < 1e-4, "{uneven:?}");
}

#[test]
fn lost_rows_and_lost_commands_make_no_delay() {
    for share in [0.1, 0.2, 0.4] {
        // Smoother commands than a step is long: a line half a step later explains them nearly as well.
        let drive = synthetic(&chain(0.06, 0.1), 2000, 0.0, 11);
        let mut random = Random::new(21);
        let lost: Vec<bool> = (0..2000).map(|_| random.uniform() < share).collect();
        let kept: Vec<usize> = (0..2000).filter(|&row| !lost[row]).collect();
        let part = |column: &[f64]| kept.iter().map(|&row| column[row]).collect::<Vec<f64>>();
        let rows = found(drive_of(part(&drive.time), part(&drive.steer_cmd), part(&drive.response)));
        let mut cells = drive;
        for (command, _) in cells.steer_cmd.iter_mut().zip(&lost).filter(|(_, lost)| **lost) {
            *command = f64::NAN;
        }
        for found in [rows, found(cells)] {
            assert!((found.delay.value - 0.16).abs() < 2e-3, "{share}: {found:?}");
        }
    }
}

#[test]
fn a_rate_limit_is_modelled() {
    for noise in [0.0, 1e-3] {
        let limited =
            found(synthetic(&SteeringChain { rate_limit: 0.1, ..chain(0.06, 0.1) }, 1500, noise, 5));
        assert!((limited.rate_limit.unwrap() - 0.1).abs() < 2e-3, "{limited:?}");
        assert!((limited.dead_time.value - 0.06).abs() < 3e-3, "{limited:?}");
        assert!((limited.lag.value - 0.1).abs() < 6e-3, "{limited:?}");
    }
}

/// Where the angle is at its limit for most of the time, a wrong limit passes for a long lag.
#[test]
fn a_rate_limit_that_governs_most_of_a_drive_leaves_no_false_lag() {
    for rate_limit in [0.04, 0.02] {
        let slow = found(synthetic(&SteeringChain { rate_limit, ..chain(0.0, 0.05) }, 2000, 1e-4, 5));
        assert!((slow.rate_limit.unwrap() / rate_limit - 1.0).abs() < 0.01, "{slow:?}");
        assert!((slow.delay.value - 0.05).abs() < 5e-3, "{slow:?}");
    }
}

/// A recorder that repeats a command has not seen the commands between.
#[test]
fn commands_that_a_recorder_repeats_make_no_delay() {
    let (time, steer_cmd) = (even(3000), commands(3000, 23, 0.05));
    let mut random = Random::new(24);
    let repeated: Vec<f64> = (0..3000).map(|row| steer_cmd[row / 5 * 5]).collect();
    for noise in [1e-4, 1e-3] {
        let response = measured(&chain(0.06, 0.1), &time, &steer_cmd, || noise * gauss(&mut random));
        let seldom = found(drive_of(time.clone(), repeated.clone(), response));
        assert_eq!(seldom.between, Between::Line, "{noise}: {seldom:?}");
        assert!((seldom.delay.value - 0.16).abs() < 5e-3, "{noise}: {seldom:?}");
        // Given so, they are what they are.
        let response = measured(&chain(0.06, 0.1), &time, &repeated, || noise * gauss(&mut random));
        let given = found(drive_of(time.clone(), repeated.clone(), response));
        // Under noise that hides the steps it does not show.
        let shown = if noise < 1e-3 { Between::Held } else { Between::Either };
        assert_eq!(given.between, shown, "{noise}: {given:?}");
        assert!((given.delay.value - 0.16).abs() < 5e-3, "{noise}: {given:?}");
    }
}

#[test]
fn backlash_is_found_beside_dead_time_and_lag() {
    for (seed, backlash, lag, noise) in [
        (4, 2e-3, 0.1, 2e-4),
        (5, 5e-3, 0.1, 2e-4),
        (6, 0.01, 0.03, 1e-3),
        (7, 0.02, 0.2, 1e-3),
        (8, 8e-3, 0.08, 0.0),
    ] {
        let loose = found(synthetic(&SteeringChain { backlash, ..chain(0.06, lag) }, 1500, noise, seed));
        let width = loose.backlash.unwrap_or_else(|| panic!("{backlash}: {loose:?}"));
        assert!(width.excited && (width.value - backlash).abs() < 0.5 * noise + 1e-5, "{loose:?}");
        assert!(
            (loose.delay.value - 0.06 - lag).abs() < 0.25 * TS && loose.rate_limit.is_none(),
            "{loose:?}"
        );
        assert!((loose.gain.value - 1.0).abs() < 5e-3, "{loose:?}");
    }
    // Beside a rate limit both are found.
    let slow = SteeringChain { backlash: 6e-3, rate_limit: 0.1, ..chain(0.06, 0.1) };
    let both = found(synthetic(&slow, 1500, 2e-4, 5));
    assert!((both.backlash.unwrap().value - 6e-3).abs() < 2e-4, "{both:?}");
    assert!((both.rate_limit.unwrap() - 0.1).abs() < 2e-3, "{both:?}");
    assert!((both.delay.value - 0.16).abs() < 3e-3, "{both:?}");
}

#[test]
fn no_backlash_is_seen_where_there_is_none() {
    let mut seen = 0;
    for seed in 0..12 {
        let limited = SteeringChain { rate_limit: 0.1, ..chain(0.06, 0.1) };
        for chain in [chain(0.06, 0.1), chain(0.0, 0.05), limited] {
            seen += usize::from(found(synthetic(&chain, 800, 1e-3, seed)).backlash.is_some());
        }
    }
    // One of a hundred by chance: of 36 more than 2 come in 6 of a thousand.
    assert!(seen <= 2, "{seen} of 36");
}

#[test]
fn intervals_hold_the_truth_of_coarse_angles_and_of_backlash() {
    let mut held = [0; 4];
    let cases = 20;
    for seed in 0..cases {
        let backlash = 5e-3;
        let mut drive = synthetic(&SteeringChain { backlash, ..chain(0.05, 0.12) }, 1500, 1e-4, seed);
        let step = 1.7e-3;
        let place = Random::new(seed + 7).uniform();
        for angle in &mut drive.response {
            *angle = ((*angle / step + place).round() - place) * step;
        }
        let found = found(drive);
        let truths = [
            (found.dead_time, 0.05),
            (found.lag, 0.12),
            (found.delay, 0.17),
            (found.backlash.unwrap(), backlash),
        ];
        for (held, (estimate, truth)) in held.iter_mut().zip(truths) {
            *held += usize::from(estimate.low <= truth && truth <= estimate.high);
        }
    }
    // Of twenty cases of nine in ten, below 13 comes in 4 of ten thousand.
    assert!(held.iter().all(|held| *held >= 13), "{held:?} of {cases}");
}

/// A drive as a log of these columns says it.
fn recorded(drive: &SteeringDrive, change: impl Fn(usize, [f64; 2]) -> [f64; 2]) -> SteeringLog {
    let rows: Vec<[f64; 2]> =
        (0..drive.time.len()).map(|row| change(row, [drive.steer_cmd[row], drive.response[row]])).collect();
    let column = |name: &str, place: usize| (name.to_owned(), rows.iter().map(|row| row[place]).collect());
    let mut columns =
        vec![("time".to_owned(), drive.time.clone()), column("steer_cmd", 0), column("steer", 1)];
    if !drive.speed.is_empty() {
        columns.push(("vx".to_owned(), drive.speed.clone()));
    }
    let log = DriveLog::from_columns(std::path::Path::new("log.csv"), columns).unwrap();
    SteeringLog::by_angle(&log, &|_| 2.7).unwrap()
}

/// The clock's unit is that in which the vehicle comes as far as its speed says.
#[test]
fn the_way_driven_tells_the_unit_of_the_clock() {
    let rows = 2000;
    let time: Vec<f64> = (0..rows).map(|row| TS * f64::from(row)).collect();
    let command = commands(rows as usize, 5, 1.0);
    for (name, ticks) in [("minutes", 1.0 / 60.0), ("0.1 ms", 1e4), ("days", 1.0 / 86_400.0)] {
        let columns = [
            ("time", time.iter().map(|time| ticks * time).collect()),
            ("steer_cmd", command.clone()),
            ("steer", measured(&chain(0.06, 0.1), &time, &command, || 0.0)),
            ("vx", vec![12.0; time.len()]),
            ("x", time.iter().map(|time| 12.0 * time).collect()),
            ("y", vec![0.0; time.len()]),
        ];
        let columns = columns.map(|(name, values)| (name.to_owned(), values)).into();
        let log = DriveLog::from_columns(std::path::Path::new("log.csv"), columns).unwrap();
        let found = SteeringLog::by_angle(&log, &|_| 2.7).unwrap();
        assert!(found.findings.iter().any(|finding| finding.summary.contains(name)), "{:?}", found.findings);
        let of = &found.drives[0].time;
        assert!((of[of.len() - 1] - of[0] - 39.98).abs() < 0.1, "{name}");
    }
}

/// A recorder that holds a slow sensor, or that writes each column in rows of its own, takes no time from the dead time.
#[test]
fn what_recorders_do_to_the_angle_takes_no_time() {
    let drive = synthetic(&chain(0.06, 0.1), 3000, 1e-4, 21);
    let angle = drive.response.clone();
    for (case, log, most) in [
        ("held", recorded(&drive, |row, [command, _]| [command, angle[row / 5 * 5]]), 8e-3),
        ("in steps", recorded(&drive, |_, [command, angle]| [command, (angle / 2e-3).round() * 2e-3]), 3e-3),
        (
            "in rows of their own",
            recorded(&drive, |row, [command, angle]| {
                // Each command stands for two rows.
                if row % 2 == 0 { [command, f64::NAN] } else { [f64::NAN, angle] }
            }),
            0.5 * TS,
        ),
    ] {
        let found = identify_from_drives(&log.drives).unwrap();
        let off = found.dead_time.value + found.lag.value - 0.16;
        assert!(off.abs() < most, "{case}: {off}, {found:?}");
    }
}

/// While the vehicle stands a person turns the wheel, and nothing commands.
#[test]
fn what_a_vehicle_does_that_stands_tells_nothing_of_its_actuator() {
    let mut drive = synthetic(&chain(0.06, 0.1), 3000, 1e-4, 26);
    drive.speed = (0..3000).map(|row| if row < 1000 { 0.0 } else { 12.0 }).collect();
    let parked =
        recorded(
            &drive,
            |row, [command, angle]| {
                if row < 1000 { [0.0, 0.2 * (0.01 * row as f64).sin()] } else { [command, angle] }
            },
        );
    assert!(
        parked.findings.iter().any(|it| it.summary.contains("20.0 s the vehicle stands")),
        "{:?}",
        parked.findings
    );
    let found = identify_from_drives(&parked.drives).unwrap();
    assert!((found.delay.value - 0.16).abs() < 3e-3 && found.excited(), "{found:?}");
}

/// A controller that is not engaged writes the angle that it measures.
#[test]
fn a_command_that_is_the_measured_angle_asks_for_nothing() {
    let drive = synthetic(&chain(0.06, 0.1), 3000, 1e-4, 27);
    let angle = drive.response.clone();
    let engaged = |row: usize| (row / 500).is_multiple_of(2);
    let log = recorded(&drive, |row, [command, _]| {
        [if engaged(row) { command } else { angle[row - 1] }, angle[row]]
    });
    let words = "for 30.0 s steer_cmd is the angle that was measured";
    assert!(log.findings.iter().any(|it| it.summary.contains(words)), "{:?}", log.findings);
    let found = identify_from_drives(&log.drives).unwrap();
    assert!((found.delay.value - 0.16).abs() < 3e-3 && found.excited(), "{found:?}");
}

#[test]
fn commands_that_come_seldom_are_said() {
    let drive = synthetic(&chain(0.06, 0.1), 3000, 1e-4, 22);
    let says = |log: &SteeringLog| log.findings.iter().any(|it| it.summary.contains("if it changed between"));
    assert!(!says(&recorded(&drive, |_, row| row)));
    // One command in three, however the rows between are written.
    let one_in = |row: usize, command: f64| if row.is_multiple_of(3) { command } else { f64::NAN };
    assert!(says(&recorded(&drive, |row, [command, angle]| [one_in(row, command), angle])));
    let commands = drive.steer_cmd.clone();
    assert!(!says(&recorded(&drive, |row, [_, angle]| [commands[row / 3 * 3], angle])));
}

#[test]
fn quantised_angles_and_other_units_serve() {
    let mut drive = synthetic(&chain(0.05, 0.08), 1500, 0.0, 13);
    for angle in &mut drive.response {
        *angle = (*angle / 2e-3).round() * 2e-3;
    }
    for command in &mut drive.steer_cmd {
        *command *= 15.87;
    }
    let found = found(drive);
    assert!(
        (found.dead_time.value - 0.05).abs() < 2e-3 && (found.lag.value - 0.08).abs() < 3e-3,
        "{found:?}"
    );
    assert!((found.gain.value * 15.87 - 1.0).abs() < 5e-3, "{found:?}");
}

#[test]
fn a_second_order_actuator_is_approximated() {
    // omega 18.85 rad/s, damping 0.7, behind 40 ms: its delay at low frequency is 0.04 + 2 D / omega.
    let (time, steer_cmd) = (even(1500), commands(1500, 8, 1.0));
    let (omega, damping, dead_time, fine) = (18.85, 0.7, 0.04, TS / 100.0);
    let (mut angle, mut rate, mut response) = (steer_cmd[0], 0.0, Vec::new());
    for k in 0..1500 {
        response.push(angle);
        for i in 0..100 {
            let then = TS * f64::from(k) + fine * f64::from(i) - dead_time;
            let command = steer_cmd[((then / TS + 1e-9).max(0.0) as usize).min(1499)];
            rate += fine * (omega * omega * (command - angle) - 2.0 * damping * omega * rate);
            angle += fine * rate;
        }
    }
    let found = found(drive_of(time, steer_cmd, response));
    assert!((found.delay.value - dead_time - 2.0 * damping / omega).abs() < 0.5 * TS, "{found:?}");
    assert!(found.dead_time.value > dead_time && found.explained > 0.99, "{found:?}");
}

/// A recorder that writes every second or fifth command has not seen the others, and nothing in its rows says so.
#[test]
fn commands_that_a_recorder_leaves_out_are_in_the_interval() {
    let (time, steer_cmd) = (even(3000), commands(3000, 23, 0.0));
    let mut random = Random::new(25);
    let response = measured(&chain(0.06, 0.1), &time, &steer_cmd, || 1e-3 * gauss(&mut random));
    for (every, off) in [(1, 2e-3), (2, 8e-3), (5, 15e-3)] {
        let thin = |column: &[f64]| column.iter().step_by(every).copied().collect();
        let seldom = found(drive_of(thin(&time), thin(&steer_cmd), thin(&response)));
        assert!(holds(&seldom.delay, 0.16), "{every}: {seldom:?}");
        assert!((seldom.delay.value - 0.16).abs() < off, "{every}: {seldom:?}");
        assert_eq!(seldom.unseen_delay > 0.0, every > 1, "{seldom:?}");
    }
}

#[test]
fn what_a_drive_does_not_excite_is_said() {
    // Slow steering tells the sum and not how it is shared out.
    let time = even(1500);
    let steer_cmd: Vec<f64> = time.iter().map(|time| 0.02 * (0.3 * time).sin()).collect();
    let mut random = Random::new(3);
    let response = measured(&chain(0.06, 0.1), &time, &steer_cmd, || 1e-3 * gauss(&mut random));
    let slow = found(drive_of(time.clone(), steer_cmd.clone(), response));
    assert!(!slow.dead_time.excited && !slow.lag.excited && !slow.excited(), "{slow:?}");
    assert!(slow.delay.excited && holds(&slow.delay, 0.16) && slow.gain.excited, "{slow:?}");

    // A command that stands tells nothing.
    let noise: Vec<f64> = time.iter().map(|_| 0.01 + 1e-3 * gauss(&mut random)).collect();
    let still = found(drive_of(time.clone(), vec![0.01; 1500], noise));
    assert!(!still.delay.excited && !still.gain.excited && !still.excited(), "{still:?}");

    // A response that has nothing to do with the command is no drive.
    let other = measured(&chain(0.0, 0.0), &time, &commands(1500, 77, 1.0), || 0.0);
    let error = identify_from_drives(&[drive_of(time.clone(), commands(1500, 5, 4.0), other)]);
    assert!(!error.as_ref().is_ok_and(IdentifiedSteering::excited), "{error:?}");
    assert_eq!(identify_from_drives(&[]), Err(DrivesError::None));
    let short = drive_of(even(10), vec![0.0; 10], vec![0.0; 10]);
    assert!(matches!(identify_from_drives(&[short]), Err(DrivesError::TooFew { .. })));
    let uneven = drive_of(even(10), vec![0.0; 9], vec![0.0; 10]);
    assert!(matches!(identify_from_drives(&[uneven]), Err(DrivesError::Lengths { .. })));
}

#[test]
fn short_drives_count_together() {
    let whole = synthetic(&chain(0.06, 0.1), 1300, 1e-3, 12);
    let part = |from: usize| {
        let cut = |column: &[f64]| column[from..from + 250].to_vec();
        drive_of(cut(&whole.time), cut(&whole.steer_cmd), cut(&whole.response))
    };
    let parts: Vec<SteeringDrive> = (0..4).map(|i| part(100 + 300 * i)).collect();
    let found = identify_from_drives(&parts).unwrap();
    assert!((found.delay.value - 0.16).abs() < 4e-3 && found.excited(), "{found:?}");
}

/// An ordinary drive of a car whose controller knows its actuator; with the yaw rate or the angle.
fn driven(
    car: &CarParameters,
    effects: &Effects,
    route: Route,
    noise: f64,
    by_yaw_rate: bool,
) -> SteeringDrive {
    let path = Arc::new(route.path().unwrap());
    let known = Actuator {
        dead_time: car.steering.dead_time + effects.steer_delay,
        time_constant: car.steering.lag + effects.steer_lag,
        ..Actuator::default()
    };
    let model = PredictionModel::Actuator(known);
    let controller = Controller::predicting_with(ControllerParameters::for_car(car), path, model).unwrap();
    let mut closed = ClosedLoop::at_start(controller, car, effects, TS).unwrap();
    let drive = closed.drive_until_lost(40.0, |_, error| error.abs() < 20.0).unwrap();
    let mut random = Random::new(3);
    let response = drive.column(if by_yaw_rate { "yaw_rate" } else { "steer" });
    SteeringDrive {
        name: "driven".into(),
        time: drive.column("time"),
        steer_cmd: drive.column("steer_cmd"),
        response: response.iter().map(|value| value + noise * gauss(&mut random)).collect(),
        speed: drive.column("vx"),
    }
}

#[test]
fn what_lies_within_a_step_of_a_coarse_angle_stands_out_of_nothing() {
    let fine = synthetic(&chain(0.0, 0.1), 3000, 0.0, 3);
    let step = 2e-3;
    // A few rows are off by almost a step.
    let off = |i: usize| if i.is_multiple_of(15) { 0.9 * step } else { 0.0 };
    let left_out = |written: &dyn Fn(f64) -> f64| {
        let response = fine.response.iter().enumerate().map(|(i, it)| written(it + off(i))).collect();
        identify_from_drives(&[SteeringDrive { response, ..fine.clone() }]).unwrap().left_out.len()
    };
    assert_eq!(left_out(&|angle| (angle / step).round() * step), 0);
    assert!(left_out(&|angle| angle) > 100);
}

#[test]
fn ordinary_drives_of_cars_tell_it() {
    for (name, route, steer_delay, steer_lag) in [
        ("c_class", Route::SudokuTest, 0.06, 0.1),
        ("bmw_320i", Route::SudokuTrain, 0.0, 0.2),
        ("ford_escort", Route::OffRoad, 0.12, 0.05),
        ("vw_vanagon", Route::HairpinCircuit, 0.03, 0.05),
        ("genesis", Route::SudokuTurns, 0.09, 0.1),
    ] {
        let car = builtin(name).unwrap();
        let effects = Effects { steer_delay, steer_lag, ..Effects::default() };
        let truth = [car.steering.dead_time + steer_delay, car.steering.lag + steer_lag];
        for noise in [0.0, 1e-3] {
            let found = found(driven(&car, &effects, route, noise, false));
            for (estimate, truth) in [(found.dead_time, truth[0]), (found.lag, truth[1])] {
                let near = if noise == 0.0 { 2e-4 } else { estimate.high - estimate.low };
                assert!((estimate.value - truth).abs() < near, "{name} {noise}: {found:?}");
            }
            assert!(found.excited() && found.gain.excited, "{name} {noise}: {found:?}");
        }
    }
}

#[test]
fn the_yaw_rate_serves_at_any_speed() {
    for (name, route, steer_delay, steer_lag) in
        [("c_class", Route::SudokuTest, 0.06, 0.1), ("ford_escort", Route::OffRoad, 0.12, 0.05)]
    {
        let car = builtin(name).unwrap();
        let effects = Effects { steer_delay, steer_lag, ..Effects::default() };
        let drive = driven(&car, &effects, route, 2e-3, true);
        let found = identify_by_yaw_rate_from_drives(&[drive], &car.single_track(), 1.5).unwrap();
        // The linear model knows neither relaxation nor roll.
        let whole = car.steering.dead_time + steer_delay + car.steering.lag + steer_lag;
        assert!((found.delay.value - whole).abs() < TS && found.delay.excited, "{name}: {found:?}");
        assert!((found.gain.value - 1.0).abs() < 0.1, "{name}: {found:?}");
    }
}

#[test]
fn by_yaw_rate_a_spike_is_wrong_and_no_row_of_a_bend() {
    for (name, route) in [("c_class", Route::SudokuTest), ("ford_escort", Route::OffRoad)] {
        let car = builtin(name).unwrap();
        let mut drive = driven(&car, &Effects::default(), route, 0.0, true);
        let found = |drive: &SteeringDrive| {
            identify_by_yaw_rate_from_drives(std::slice::from_ref(drive), &car.single_track(), 1.5).unwrap()
        };
        // The linear model misses the bends, by far more than there is noise.
        let sound = found(&drive);
        assert!(sound.rmse > 1e-5, "{name}: {sound:?}");
        assert!(sound.left_out.is_empty(), "{name}: {:?}", sound.left_out);
        for (row, spike) in [(300, 0.05), (700, -0.05), (701, -0.07)] {
            drive.response[row] += spike;
        }
        let rows: Vec<u32> = found(&drive).left_out.iter().map(|one| one.row).collect();
        assert_eq!(rows, [300, 700, 701], "{name}");
    }
}

#[test]
fn intervals_of_gain_and_offset_by_yaw_rate_know_that_the_linear_model_is_wrong() {
    for (name, route, gain, offset, steer_delay, steer_lag) in [
        ("c_class", Route::SudokuTest, 1.1, 0.01, 0.06, 0.1),
        ("bmw_320i", Route::SudokuTrain, 0.95, -0.005, 0.1, 0.15),
        ("genesis", Route::SudokuTurns, 1.0, 0.0, 0.02, 0.0),
        ("vw_vanagon", Route::HairpinCircuit, 1.05, 0.005, 0.0, 0.1),
        ("ford_escort", Route::OffRoad, 0.95, 0.0, 0.12, 0.05),
    ] {
        let car = builtin(name).unwrap();
        let effects =
            Effects { steer_delay, steer_lag, steer_gain: gain, steer_offset: offset, ..Effects::default() };
        let drive = driven(&car, &effects, route, 0.0, true);
        let found = identify_by_yaw_rate_from_drives(&[drive], &car.single_track(), 1.5).unwrap();
        for (estimate, truth) in [(found.gain, gain), (found.offset, offset)] {
            assert!(holds(&estimate, truth), "{name}: {truth} {found:?}");
        }
        // Wide enough to hold the truth, and narrow enough to tell something.
        assert!(found.delay.high - found.delay.low < 0.1, "{name}: {found:?}");
        assert!(found.gain.high - found.gain.low < 0.6, "{name}: {found:?}");
    }
}
