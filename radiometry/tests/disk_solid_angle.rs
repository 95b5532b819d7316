//! The solid angle of a disk from beside its axis: against 400-digit values of Paxton's formula,
//! against cubature and quasi-Monte Carlo over the disk's area, and in its limits.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use radiometry::quadrature::{Cell, cubature, quasi_monte_carlo};
use radiometry::shape::Disk;
use radiometry::solid_angle::{disk, disk_from, disk_off_axis};
use radiometry::{Tolerance, direction};

/// Radius, distance, offset, and the solid angle, sr: Paxton 1959, eqs. 24 to 26, in 400 digits
/// (mpmath's complete elliptic integrals), for the doubles as they stand here.
#[expect(clippy::unreadable_literal, clippy::excessive_precision, reason = "as computed")]
const PAXTON: &[(f64, f64, f64, f64)] = &[
    (1.0, 2.0, 0.5, 6.2285606797149514e-1),
    (1.0, 2.0, 1.5, 3.9437876938907512e-1),
    (1.0, 1.0, 1.0, 1.12268683361137),
    (1.0, 0.001, 1.0, 3.132605457268331),
    (1.0, 1e-09, 1.0, 3.1415926307870859),
    (1.0, 0.1, 0.999, 2.723339451324445),
    (1.0, 0.1, 1.001, 2.6838723566332076),
    (1.0, 1e-06, 1.0000001, 2.9422394585160469),
    (1.0, 1e-06, 0.9999999, 3.340914068489825),
    (1.0, 1e-08, 3.0, 1.3279820381863791e-9),
    (0.001, 1.0, 1.0, 1.1107208386695683e-6),
    (1e-09, 1.0, 0.5, 2.2479407139330327e-18),
    (1.0, 1000000.0, 1000000.0, 1.1107207345396957e-12),
    (1.0, 1000000000.0, 0.5, 3.1415926535897932e-18),
    (1.0, 1000000.0, 1.0000001, 3.1415926535827247e-12),
    (1.0, 100.0, 99.0, 1.1275169839185104e-4),
    (1.0, 3.0, 0.0, 3.2243234770192574e-1),
    (1.0, 3.0, 1e-200, 3.2243234770192574e-1),
    (5.0, 1e-300, 20.0, 1.0555770209475839e-302),
    (1.0, 1e-12, 0.5, 6.28318530717176),
    (1.0, 30.0, 1.0, 3.4819587005000632e-3),
    (1.0, 0.5, 100000000.0, 1.5707963267948967e-24),
    (100000.0, 0.001, 100000.000000001, 3.1415904404242689),
    (2.0, 7.0, 1.9999999999999998, 2.179181210374344e-1),
    (1e-150, 1e-10, 3.0, 1.1635528346628864e-311),
    (1.0, 50.0, 0.9, 1.2556503273556759e-3),
    (0.08950731063349585, 0.6450666316687975, 0.014845318090508227, 5.9580967051517613e-2),
    (2.6448321811154014, 230.00051120744672, 1.7289886656373326, 4.1534466780614217e-4),
    (96.06813109563441, 0.1958143668256522, 10031.088215101621, 5.6254047377876252e-9),
    (0.0846619020921237, 0.0011517457927265344, 30.387911445760896, 9.2423792477000376e-10),
    (4.848929853386409, 0.0002806855579723755, 4.850964547259431, 2.7359933306069268e-1),
    (13.191857651045233, 58.20946110051807, 13.197615011125448, 1.4499882075671671e-1),
    (7.186508348745311, 280.3436174959536, 7.196473855990055, 2.0613976574415249e-3),
    (71.84143637648808, 0.0008690480238118427, 71.68805213648433, 6.2717540975711404),
    (0.07378154835275434, 573.2723194345821, 0.07382459302814484, 5.2038340895901618e-8),
    (0.48372000675519544, 68.28728402645105, 0.4837959811948274, 1.5761924960058418e-4),
    (2.172737058855713, 213.50713649457862, 2.1770332549009104, 3.2526548443732796e-4),
    (92.03617887215918, 4.999364421013424, 0.8761053074530711, 5.9423648516038625),
    (7.165856066913075, 0.0030052104180949913, 7.16828304446319, 1.7788617606032697),
    (0.031458596768474, 0.23659739533332944, 0.03145620773370982, 5.343422170195426e-2),
    (15.936072065350563, 0.07468489786625586, 15.920953265661234, 3.5062559358258653),
    (30.979050207595108, 0.00020385925272308177, 30.914197631389683, 6.2768441208867335),
    (1.597370884157565, 283.907176594344, 0.07548258015922059, 9.9448515003268318e-5),
    (0.17325278076263695, 0.0003457760692212213, 0.6874752485206165, 1.0803125548405706e-4),
    (76.86252238058944, 0.01099731819144863, 76.92971059594103, 3.231787977071416e-1),
    (0.18002054810890955, 513.5893209250318, 0.17991926080620316, 3.8597745867228227e-7),
    (30.169359001245468, 0.05050688854467949, 4792.490950817629, 1.312103551459841e-9),
    (3.0234621892217715, 384.0155299206926, 3.331696537267388, 1.9471175076721807e-4),
    (55.68569078535797, 0.11537728556078584, 55.63519284583396, 3.9497696820566506),
    (0.011112964972015556, 0.0806254973439638, 0.033544492692206176, 4.6615521829035375e-2),
    (0.01739089938590925, 2.462565342754224, 0.017405263612613294, 1.5666415750074369e-4),
    (2.725559524344536, 0.008963360783265602, 2.357615018678178, 6.2198625842147625),
    (71.32180431886566, 0.005726060696939598, 71.35224880402978, 3.7103205951763315e-1),
    (0.05124884531494174, 0.001980260463138831, 0.051330059379944004, 2.8538053705061554),
    (0.15908011397222296, 0.04366388648804931, 6.843154859577233, 1.0838582665129135e-5),
    (0.17380680716411245, 0.0036121427040887817, 11.558801456847759, 2.2203443916848563e-7),
    (5.1553059915423365, 3.5218669179607067, 5.1576978440695695, 1.4872486942643477),
    (5.008522040712485, 0.0037258259790541163, 361.6592354452171, 6.2084995011354294e-9),
    (0.22224957552323824, 3.5614482162373458, 45.313809203940835, 5.8852717559129239e-6),
    (14.061373736179442, 0.00017272786500112288, 7825.533051707717, 2.2388632514804094e-13),
    (28.5043016824547, 0.024030769106394234, 28.44994779993883, 5.4436610093094571),
    (2.2799378311592595, 0.0889010196956579, 2.2836153273793682, 2.8515778941791303),
    (0.2428941877685403, 0.08285903500769704, 0.24279300308788732, 2.0728115733667092),
    (0.04207183317764875, 0.00010780342577775208, 0.042145517635744596, 1.9223474137394689),
    (1.7198318967067405, 794.9049864668539, 1.7161317869980364, 1.4705739468829284e-5),
    (22.22259221951017, 4.374318522990267, 22.201013493676303, 2.4230772377095987),
    (36.20899240063729, 107.32919404708251, 5089.827049482287, 3.3506312539278961e-6),
    (17.40874709105694, 0.00020679387466432093, 4596.457055053948, 2.0274958008068272e-12),
    (38.571689311682476, 198.48324526029208, 111.68351758905904, 7.7850404843254337e-2),
    (0.04867280353340273, 0.012566562081861934, 0.04867839947973294, 2.2568722836474108),
    (0.016330011751052198, 246.37313744805178, 0.016301865610206846, 1.3801813504429125e-8),
    (17.628105915601964, 0.000268891378266741, 0.37241287628819353, 6.2830894341384132),
    (0.04844054748787096, 34.80995262084582, 16.43645331945439, 4.4982878965240419e-6),
    (0.8912619609408945, 0.9914416060168557, 0.22473501750764494, 1.56634880359482),
    (0.11867095704022708, 0.4907533230001847, 0.04094948754373475, 1.7436631918722316e-1),
    (26.797221702169516, 26.71275180739456, 26.74172607993061, 1.128114872398096),
    (79.20819646345845, 95.75082909799056, 79.208969776214, 9.4196404628338659e-1),
    (0.042478250857461826, 0.0003179991703815889, 0.04245666699133162, 3.2249229915778564),
    (0.27754815356137225, 0.002175574723988196, 0.026061305147295016, 6.2336074207119446),
    (7.314275055855478, 0.045884545554037086, 7.303455717651991, 3.5599891203456484),
    (0.697061975425508, 3.563676571167111, 1.2337108396054575, 9.9549636231483157e-2),
    (3.1024589230900514, 0.10499175162530079, 3.1024039401625436, 2.9576879058258519),
    (0.4809009013334098, 7.225409761442403, 0.48033668626911286, 1.3779881526506247e-2),
    (6.034990504273876, 0.00031700563335817014, 2.1380008022582064, 6.2828200334724996),
    (55.710400966101545, 0.04165334447756122, 55.78508742412515, 1.01109252035687),
    (0.03060581058802551, 6.821622935294901, 0.03063846062429127, 6.3235728719662355e-5),
];

#[test]
fn it_is_as_paxton_says() {
    for &(radius, distance, offset, expected) in PAXTON {
        let found = disk_off_axis(radius, distance, offset).unwrap().sr();
        let error = (found - expected).abs();
        // Subnormal answers have fewer digits.
        assert!(
            error <= 1e-14 * expected + 1e-322,
            "{radius}, {distance}, {offset}: {found:e}, expected {expected:e}: {:e}",
            error / expected
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 60,
        rng_seed: RngSeed::Fixed(20_261_122),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    /// ∬ h/(h² + |x - foot|²)^(3/2) dA.
    #[test]
    fn it_is_the_integral_over_its_area(
        radius in 0.1..3.0f64, distance in 0.3..3.0f64, offset in 0.0..6.0f64
    ) {
        let element = |rho: f64, psi: f64| {
            let aside = (rho * psi.cos() - offset).powi(2) + (rho * psi.sin()).powi(2);
            rho * distance / (distance * distance + aside).powf(1.5)
        };
        let half = [Cell::Rectangle(DVec2::ZERO, DVec2::new(radius, PI))];
        let tolerance = Tolerance::from_relative(1e-10).unwrap();
        let expected = cubature(|at| 2.0 * element(at.x, at.y), &half, tolerance).unwrap();
        let found = disk_off_axis(radius, distance, offset).unwrap().sr();
        prop_assert!((found - expected.value).abs() <= expected.error_bound + 1e-14 * found);
        let square = |p: &[f64; 2]| {
            2.0 * radius * PI * element(radius * p[0], PI * p[1])
        };
        let tolerance = Tolerance::from_relative(1e-3).unwrap();
        let sampled = quasi_monte_carlo(square, 7, tolerance).unwrap();
        prop_assert!((found - sampled.value).abs() <= 2.0 * sampled.error_bound, "{found} {sampled:?}");
    }

    /// One answer however the disk is placed, turned, mirrored and scaled.
    #[test]
    fn it_depends_on_nothing_but_the_view(
        radius in 0.01..3.0f64, distance in -3.0..3.0f64, offset in 0.0..6.0f64,
        tilt in 0.0..PI, around in -PI..PI, exponent in -300..300i32, turn in -PI..PI
    ) {
        prop_assume!(distance.abs() > 1e-3);
        let expected = disk_off_axis(radius, distance.abs(), offset).unwrap().sr();
        let scale = 2f64.powi(exponent);
        let scaled = disk_off_axis(radius * scale, distance.abs() * scale, offset * scale).unwrap();
        prop_assert!((scaled.sr() / expected - 1.0).abs() < 1e-15);
        let axis = direction::unit(tilt, around);
        let (t, b) = direction::frame(axis);
        let center = DVec3::new(1.0, -2.0, 0.5);
        let point = center + distance * axis + offset * (turn.cos() * t + turn.sin() * b);
        let found = disk_from(point, &Disk::new(center, -7.0 * axis, radius).unwrap()).unwrap();
        // The point is rounded: by as much as changes the view.
        let sure = 1e-14 * (1.0 + 1.0 / distance.abs()) * (1.0 + radius / distance.abs());
        prop_assert!((found.sr() - expected).abs() <= sure * expected.max(1e-3), "{found} {expected}");
    }

    /// Whatever doubles come in: an answer within 0 and 2π, or an error.
    #[test]
    fn no_doubles_make_nan(bits in proptest::array::uniform3(any::<u64>()), exact in any::<bool>()) {
        let [a, b, c] = bits.map(|bits| f64::from_bits(bits).abs());
        let offset = if exact { a } else { c };
        if let Ok(found) = disk_off_axis(a, b, offset) {
            prop_assert!((0.0..=2.0 * PI).contains(&found.sr()), "{a:e} {b:e} {offset:e}: {found}");
        }
        let point = DVec3::new(a, b, c);
        if let Ok(found) = Disk::new(DVec3::new(b, c, a), point, c).and_then(|d| disk_from(point, &d)) {
            prop_assert!((0.0..=2.0 * PI).contains(&found.sr()));
        }
    }

    /// Nearer the axis it is larger, and a larger disk is.
    #[test]
    fn it_grows_towards_the_axis_and_with_the_radius(
        radius in -6.0..6.0f64, distance in -6.0..6.0f64, offset in -6.0..6.0f64, more in 1.001..2.0f64
    ) {
        let [radius, distance, offset] = [radius, distance, offset].map(|e: f64| 10f64.powf(e));
        let at = |radius: f64, offset: f64| disk_off_axis(radius, distance, offset).unwrap().sr();
        let here = at(radius, offset);
        prop_assert!(at(radius, offset * more) <= here * (1.0 + 2e-14));
        prop_assert!(at(radius * more, offset) >= here * (1.0 - 2e-14));
        prop_assert!(here <= disk(radius, distance).unwrap().sr() * (1.0 + 2e-14));
    }
}

#[test]
fn on_the_axis_it_is_the_closed_form_of_the_axis() {
    for exponent in -12..12 {
        let distance = 10f64.powi(exponent);
        let expected = disk(1.0, distance).unwrap().sr();
        let found = disk_off_axis(1.0, distance, 0.0).unwrap().sr();
        assert!((found / expected - 1.0).abs() < 2e-15, "{distance}: {found} {expected}");
    }
}

#[test]
#[expect(clippy::float_cmp, reason = "limits are exact")]
fn edge_on_it_is_nothing_outside_and_half_of_all_inside() {
    assert_eq!(disk_off_axis(1.0, 0.0, 1.5).unwrap().sr(), 0.0);
    assert_eq!(disk_off_axis(1.0, 0.0, 0.5).unwrap().sr(), 2.0 * PI);
    assert_eq!(
        disk_off_axis(1.0, 0.0, 1.0).unwrap_err().to_string(),
        "the receiver lies on the disk's rim, expected a point off it"
    );
    assert_eq!(disk_off_axis(0.0, 0.0, 0.0).unwrap().sr(), 0.0);
    // Over the rim, coming down: a quarter of the sphere.
    assert!((disk_off_axis(1.0, 1e-15, 1.0).unwrap().sr() - PI).abs() < 1e-13);
    assert!(disk_off_axis(-1.0, 1.0, 1.0).is_err() && disk_off_axis(1.0, f64::NAN, 1.0).is_err());
    // From far out, low over the plane: π r² h/d³.
    let low = disk_off_axis(1.0, 1e-3, 1e6).unwrap().sr();
    assert!((low / (PI * 1e-3 / 1e18) - 1.0).abs() < 1e-11, "{low:e}");
    let flat = disk_from(DVec3::X * 3.0, &Disk::new(DVec3::ZERO, DVec3::Z, 1.0).unwrap());
    assert_eq!(flat.unwrap().sr(), 0.0);
}
