fn main() {
    use rubor_rig::skin::monte_carlo::*;
    let photons: u64 = std::env::args().nth(1).unwrap().parse().unwrap();
    let t = std::time::Instant::now();
    let table = AlbedoTable::build(0.0, 1.4, photons, 1).unwrap();
    println!("table {:?}", t.elapsed());
    println!("{:?} {:?}", table.result.total, table.result.total_error);
    for a in [0.958549, 0.838, 0.678] {
        let t = std::time::Instant::now();
        let r = PhotonWalk::isotropic(1.4, vec![a], photons, 2).run().unwrap();
        println!(
            "walk {a} {:?} {:?} {:?} noise {}",
            t.elapsed(),
            r.total,
            r.total_error,
            r.ring_error[0].iter().sum::<f64>() / r.total[0]
        );
        let r =
            PhotonWalk { estimator: Estimator::Analog, ..PhotonWalk::isotropic(1.4, vec![a], photons, 2) }
                .run()
                .unwrap();
        println!(
            "analog {a} {:?} {:?} {:?} noise {}",
            t.elapsed(),
            r.total,
            r.total_error,
            r.ring_error[0].iter().sum::<f64>() / r.total[0]
        );
    }
}
