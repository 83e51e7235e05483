/* What an accuracy costs with Simbody: 100 s of the EzyRoller with a massive steering assembly, as benchmarks/peers.c.
 * Prints "error[m] processor-time[ms]" of a run by the Runge-Kutta-Merson method for each accuracy; its CPODES (BDF) took
 * longer for the same error and lost its steps at the looser ones.
 *     c++ -O2 -I/usr/include/simbody simbody.cpp -o simbody -lSimTKsimbody -lSimTKmath -lSimTKcommon */
#include <cmath>
#include <cstdio>
#include <ctime>
#include "Simbody.h"
using namespace SimTK;

namespace {

const Real a = 0.5, b = 0.5, c = 0.125, d = 0.125, m1 = 1, I1 = 0.1, m2 = 0.1, I2 = 0.01, M0 = 0.1, omega = Pi;
/* x, y of both centres of mass at 100 s, in quadruple precision (peers_exact of benchmarks/peers.c) */
const Real exact[4] = { 85.776831285852169, -52.654687622986008, 86.105849606538573, -52.834610154037750 };

class Rider : public Force::Custom::Implementation {
public:
  Rider (const MobilizedBody &first, const MobilizedBody &second) : frame (first), steer (second) {}
  void calcForce (const State &state, Vector_<SpatialVec> &bodies, Vector_<Vec3> &, Vector &) const override {
    const Vec3 moment (0, 0, M0 * std::cos (omega * state.getTime ()));
    frame.applyBodyTorque (state, moment, bodies);
    steer.applyBodyTorque (state, -moment, bodies);
  }
  Real calcPotentialEnergy (const State &) const override { return 0; }

private:
  const MobilizedBody &frame, &steer;
};

void run (Real accuracy) {
  MultibodySystem system;
  SimbodyMatterSubsystem matter (system);
  GeneralForceSubsystem forces (system);
  MobilizedBody::Planar frame (matter.Ground (), Transform (),
                               Body::Rigid (MassProperties (m1, Vec3 (0), UnitInertia (1, 1, I1 / m1) * m1)),
                               Transform ());
  MobilizedBody::Pin steer (frame, Vec3 (b, 0, 0),
                            Body::Rigid (MassProperties (m2, Vec3 (0), UnitInertia (1, 1, I2 / m2) * m2)),
                            Vec3 (-d, 0, 0));
  /* the wheels: no velocity across the heading */
  Constraint::NoSlip1D A (frame, Vec3 (-a, 0, 0), UnitVec3 (YAxis), matter.Ground (), frame);
  Constraint::NoSlip1D C (steer, Vec3 (c, 0, 0), UnitVec3 (YAxis), matter.Ground (), steer);
  Force::Custom rider (forces, new Rider (frame, steer));
  State state = system.realizeTopology ();
  steer.setAngle (state, Pi);
  RungeKuttaMersonIntegrator integrator (system);
  integrator.setAccuracy (accuracy);
  const std::clock_t begin = std::clock ();
  TimeStepper stepper (system, integrator);
  stepper.initialize (state);
  stepper.stepTo (100);
  const double ms = 1e3 * double (std::clock () - begin) / CLOCKS_PER_SEC;
  const State &end = integrator.getState ();
  Real error = 0;
  for (int i = 0; i < 2; i++) {
    const Vec3 at = i ? steer.getBodyOriginLocation (end) : frame.getBodyOriginLocation (end);
    for (int k = 0; k < 2; k++) error = std::fmax (error, std::fabs (at[k] - exact[2 * i + k]));
  }
  std::printf ("%.3g %.4g\n", error, ms);
  std::fflush (stdout);
}

} // namespace

int main () {
  for (Real accuracy = 1e-4; accuracy > 2e-12; accuracy /= 10) run (accuracy);
}
