//! Dormand's and Prince's explicit method of order 8 in fixed steps, for runs of 1e7 steps: more digits per evaluation than `rk4`.

use pliant::integrate::chart::Chart;
use pliant::integrate::tableau::Tableau;
use pliant::integrate::{RungeKutta, Stepper};
use pliant::model::{State, System};

/// Weights of the kept solution of the pair 8(5,3), to double precision (Hairer, Norsett, Wanner: Solving Ordinary Differential Equations I,
/// II.10, code DOP853).
pub const DOP853: Tableau = Tableau {
    name: "dop853",
    c: &[
        0.0,
        0.05260015195876773,
        0.0789002279381516,
        0.1183503419072274,
        0.2816496580927726,
        0.3333333333333333,
        0.25,
        0.3076923076923077,
        0.6512820512820513,
        0.6,
        0.8571428571428571,
        1.0,
    ],
    a: &[
        &[],
        &[0.05260015195876773],
        &[0.0197250569845379, 0.0591751709536137],
        &[0.02958758547680685, 0.0, 0.08876275643042054],
        &[0.2413651341592667, 0.0, -0.8845494793282861, 0.924834003261792],
        &[0.037037037037037035, 0.0, 0.0, 0.17082860872947386, 0.12546768756682242],
        &[0.037109375, 0.0, 0.0, 0.17025221101954405, 0.06021653898045596, -0.017578125],
        &[0.03709200011850479, 0.0, 0.0, 0.17038392571223998, 0.10726203044637328, -0.015319437748624402, 0.008273789163814023],
        &[0.6241109587160757, 0.0, 0.0, -3.3608926294469414, -0.868219346841726, 27.59209969944671, 20.154067550477894, -43.48988418106996],
        &[
            0.47766253643826434,
            0.0,
            0.0,
            -2.4881146199716677,
            -0.590290826836843,
            21.230051448181193,
            15.279233632882423,
            -33.28821096898486,
            -0.020331201708508627,
        ],
        &[
            -0.9371424300859873,
            0.0,
            0.0,
            5.186372428844064,
            1.0914373489967295,
            -8.149787010746927,
            -18.52006565999696,
            22.739487099350505,
            2.4936055526796523,
            -3.0467644718982196,
        ],
        &[
            2.273310147516538,
            0.0,
            0.0,
            -10.53449546673725,
            -2.0008720582248625,
            -17.9589318631188,
            27.94888452941996,
            -2.8589982771350235,
            -8.87285693353063,
            12.360567175794303,
            0.6433927460157636,
        ],
    ],
    b: &[
        0.054293734116568765,
        0.0,
        0.0,
        0.0,
        0.0,
        4.450312892752409,
        1.8915178993145003,
        -5.801203960010585,
        0.3111643669578199,
        -0.1521609496625161,
        0.20136540080403034,
        0.04471061572777259,
    ],
    error: &[],
    dense: &[],
    order: 8,
};

/// Phase error and loss of amplitude (both relative to one) of one step of an oscillation by `y` radians, from the method's stability
/// polynomial R(i y).
pub fn step_errors(y: f64) -> (f64, f64) {
    // R(z) - e^z, so that nothing cancels: orders below 9 agree
    let polynomial = DOP853.stability_polynomial();
    let (mut factorial, mut re, mut im) = (1.0, 0.0, 0.0);
    for k in 1..30_u32 {
        factorial *= f64::from(k);
        let own = if k < 9 { 1.0 / factorial } else { polynomial.get(k as usize).copied().unwrap_or(0.0) };
        let term = (own - 1.0 / factorial) * y.powi(k as i32);
        match k % 4 {
            0 => re += term,
            1 => im += term,
            2 => re -= term,
            _ => im -= term,
        }
    }
    // (R - e^(iy)) e^(-iy) = loss + i phase
    let (s, c) = y.sin_cos();
    ((im * c - re * s).abs(), (re * c + im * s).abs())
}

/// Runs `steps` steps to `duration`, with `watch` after every `every` of them.
pub fn run(system: &System, start: &State, duration: f64, steps: u32, every: u32, mut watch: impl FnMut(&State)) -> State {
    let mut chart = Chart::new(system, start);
    let mut stepper = RungeKutta::new(DOP853, None, &chart);
    stepper.restart(&mut chart).unwrap();
    let h = duration / f64::from(steps);
    for step in 1..=steps {
        stepper.attempt(&mut chart, h).unwrap();
        stepper.accept(&mut chart);
        if step % every == 0 {
            watch(&chart.base);
        }
    }
    chart.base
}
