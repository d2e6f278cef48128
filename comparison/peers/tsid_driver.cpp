// Replays recorded states through TSID's C++ library, without Python: tsid_cpp_worker.py compiles and calls it.
//
//     tsid_driver HEADER DATA RESULT
//
// Tasks are TSID's own, with the desired accelerations that are handed over. Contacts are ContactPoint and Contact6d,
// changed in what their virtual methods say, so that the program is the common one:
//
// - a held foot follows a desired acceleration, which TSID's contacts have as zero;
// - Contact6d regularises the wrench, and its corners' forces hardly at all. Here their own squares are weighed;
// - Contact6d has the axes of its sole. Here its cones are about the vertical, as those of ContactPoint are;
// - a held sole that rolls lifts corners: its last row, the bounds of the sum of normal forces, has those instead.
//
// A thruster is a point without friction rows; its motion task counts nothing.
// The solver adds REGULARISATION to the Hessian's diagonal and has no switch for it: the weights of forces and joints
// are lowered by as much, so that the sum is the program's. It pulls accelerations to zero: the joints' are raised as
// much, so that weight times target stays the same.
// HEADER is text, DATA and RESULT are float64 in the order in which they are read and written below.

#include <tsid/contacts/contact-6d.hpp>
#include <tsid/contacts/contact-point.hpp>
#include <tsid/formulations/inverse-dynamics-formulation-acc-force.hpp>
#include <tsid/robots/robot-wrapper.hpp>
#include <tsid/solvers/solver-HQP-eiquadprog-fast.hpp>
#include <tsid/tasks/task-actuation-bounds.hpp>
#include <tsid/tasks/task-com-equality.hpp>
#include <tsid/tasks/task-joint-posture.hpp>
#include <tsid/tasks/task-se3-equality.hpp>

#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/parsers/urdf.hpp>

#include <chrono>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <set>

using namespace tsid;
using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;
using Sample = trajectories::TrajectorySample;
using Solver = solvers::SolverHQuadProgFast;

const double REGULARISATION = 1e-8;  // TSID's DEFAULT_HESSIAN_REGULARIZATION
const double FREE = 1e6;             // a bound that no force reaches, N

struct Settings {
    std::string urdf, base;
    std::vector<std::string> contacts, thrusters, soles;
    long ticks, repetitions, centred;
    double mu, body, orientation, swing, thrust, force;
    pinocchio::Model model;
    Vector limit, weights;  // of each joint
    Matrix corners;         // (12, soles)
    // A column for each tick.
    Matrix q, v, body_target, orientation_target, feet_target, joint_target, brake, held, loaded, sole_target, resistance;
};

static Matrix read(std::istream &in, long rows, long columns)
{
    Matrix out(rows, columns);
    in.read(reinterpret_cast<char *>(out.data()), sizeof(double) * rows * columns);
    if (!in) throw std::runtime_error("DATA is too short");
    return out;
}

static std::vector<std::string> names(std::istream &in)
{
    size_t count;
    in >> count;
    std::vector<std::string> out(count);
    for (auto &name : out) in >> name;
    return out;
}

static Settings load(const char *header, const char *data)
{
    Settings s;
    std::ifstream text(header), raw(data, std::ios::binary);
    std::getline(text, s.urdf);
    text >> s.base >> s.ticks >> s.repetitions >> s.centred;
    text >> s.mu >> s.body >> s.orientation >> s.swing >> s.thrust >> s.force;
    s.contacts = names(text);
    s.thrusters = names(text);
    s.soles = names(text);
    if (!text) throw std::runtime_error("HEADER is too short");
    pinocchio::urdf::buildModel(s.urdf, pinocchio::JointModelFreeFlyer(), s.model);
    const long nv = s.model.nv, joints = nv - 6, n = s.ticks, points = s.contacts.size();
    s.model.armature = read(raw, nv, 1);
    s.limit = read(raw, joints, 1);
    s.weights = read(raw, joints, 1);
    s.corners = read(raw, 12, s.soles.size());
    s.q = read(raw, s.model.nq, n);
    s.v = read(raw, nv, n);
    s.body_target = read(raw, 3, n);
    s.orientation_target = read(raw, 3, n);
    s.feet_target = read(raw, 3 * points, n);
    s.joint_target = read(raw, joints, n);
    s.brake = read(raw, joints, n);
    s.held = read(raw, points, n);
    s.loaded = read(raw, points, n);
    s.sole_target = read(raw, 6 * s.soles.size(), n);
    s.resistance = read(raw, nv, n).bottomRows(joints);
    return s;
}

static Sample frame_sample()
{
    Sample sample(12, 6);
    Vector value = Vector::Zero(12);
    value[3] = value[7] = value[11] = 1.0;
    sample.setValue(value);
    return sample;
}

// A point that is held, with a desired acceleration in world axes.
struct Point : contacts::ContactPoint {
    Point(const std::string &name, robots::RobotWrapper &robot, double mu)
        : ContactPoint(name, robot, name, Vector3::UnitZ(), mu, 0.0, FREE)
    {
        useLocalFrame(false);
        setReference(pinocchio::SE3::Identity());
        const math::Vector ones = math::Vector::Ones(3);
        m_motionTask.Kp(math::Vector::Zero(6));
        m_motionTask.Kd(math::Vector::Zero(6));
        setRegularizationTaskWeightVector(ones);
    }
    void aim(Sample &sample) { m_motionTask.setReference(sample); }
};

// A force in any direction, without rows of its own.
struct FreeForce : Point {
    math::ConstraintInequality none;

    FreeForce(const std::string &name, robots::RobotWrapper &robot) : Point(name, robot, 1.0), none(name, 0, 3) {}
    const math::ConstraintInequality &getForceConstraint() const override { return none; }
    const math::ConstraintInequality &computeForceTask(double, math::ConstRefVector, math::ConstRefVector,
                                                       const pinocchio::Data &) override
    {
        return none;
    }
};

// A sole that is held: forces of its corners in world axes, each with a weight on its square.
struct Sole : contacts::Contact6d {
    pinocchio::FrameIndex frame;
    Eigen::Matrix<double, 3, 4> local, turned;
    math::ConstraintEquality squares;

    Sole(const std::string &name, robots::RobotWrapper &robot, const Matrix &corners, double mu, const Vector &loaded)
        : Contact6d(name, robot, name, corners, Vector3::UnitZ(), mu, 0.0, FREE), frame(robot.model().getFrameId(name)),
          local(corners), squares(name, Matrix::Identity(12, 12), math::Vector::Zero(12))
    {
        m_motionTask.useLocalFrame(false);
        m_motionTask.Kp(math::Vector::Zero(6));
        m_motionTask.Kd(math::Vector::Zero(6));
        setReference(pinocchio::SE3::Identity());
        if (loaded.minCoeff() > 0.0) return;
        Matrix rows = m_forceInequality.matrix();
        for (long k = 0; k < 4; k++) rows(rows.rows() - 1, 3 * k + 2) = loaded[k] > 0.0 ? 0.0 : 1.0;
        m_forceInequality.setMatrix(rows);
        m_forceInequality.upperBound()[rows.rows() - 1] = 0.0;
    }
    void aim(Sample &sample) { m_motionTask.setReference(sample); }
    const math::ConstraintBase &computeMotionTask(double t, math::ConstRefVector q, math::ConstRefVector v,
                                                  pinocchio::Data &data) override
    {
        turned.noalias() = data.oMf[frame].rotation() * local;
        for (long k = 0; k < 4; k++) m_forceGenMat.block<3, 3>(3, 3 * k) = pinocchio::skew(turned.col(k));
        return Contact6d::computeMotionTask(t, q, v, data);
    }
    const math::ConstraintEquality &getForceRegularizationTask() const override { return squares; }
    const math::ConstraintEquality &computeForceRegularizationTask(double, math::ConstRefVector, math::ConstRefVector,
                                                                   const pinocchio::Data &) override
    {
        return squares;
    }
};

// TSID's formulation and solver for one set of held feet and loaded corners.
struct Formulation {
    robots::RobotWrapper robot;
    InverseDynamicsFormulationAccForce inverse;
    Solver solver;
    std::vector<std::shared_ptr<tasks::TaskSE3Equality>> frames;
    std::vector<std::pair<long, std::shared_ptr<tasks::TaskSE3Equality>>> swinging;
    std::vector<std::pair<long, std::shared_ptr<Point>>> points;
    std::vector<std::pair<long, std::shared_ptr<Sole>>> soles;
    std::vector<std::shared_ptr<FreeForce>> thrusters;
    std::vector<std::pair<double, std::shared_ptr<tasks::TaskJointPosture>>> postures;  // with a factor of the target
    std::vector<std::pair<long, std::shared_ptr<tasks::TaskJointPosture>>> brakes;
    std::shared_ptr<tasks::TaskActuationBounds> bounds;
    std::shared_ptr<tasks::TaskSE3Equality> body, orientation;
    std::shared_ptr<tasks::TaskComEquality> centre;

    Formulation(const Settings &s, const Vector &held, const Vector &loaded)
        : robot(s.model, false), inverse("tsid", robot, false), solver("solver")
    {
        inverse.computeProblemData(0.0, pinocchio::neutral(s.model), Vector::Zero(s.model.nv));
        body = task("body", s.base, {!s.centred, !s.centred, 1, 0, 0, 0}, s.body);
        orientation = task("orientation", s.base, {0, 0, 0, 1, 1, 1}, s.orientation);
        if (s.centred) {
            centre = std::make_shared<tasks::TaskComEquality>("centre", robot);
            centre->Kp(Vector::Zero(3));
            centre->Kd(Vector::Zero(3));
            centre->setMask(Eigen::Vector3d(1.0, 1.0, 0.0));
            inverse.addMotionTask(*centre, s.body, 1, 0.0);
        }
        for (const double full : std::set<double>(s.weights.begin(), s.weights.end())) {
            const double weight = full - REGULARISATION;
            const Vector mask = (s.weights.array() == full).cast<double>();
            postures.emplace_back(full / weight, posture("posture " + std::to_string(postures.size()), mask, weight));
        }
        for (long j = 0; j < s.limit.size(); j++)
            if (s.brake.row(j).maxCoeff() > 0.0)
                brakes.emplace_back(j, posture("brake " + std::to_string(j), Vector::Unit(s.limit.size(), j), 0.0));
        bounds = std::make_shared<tasks::TaskActuationBounds>("torque", robot);
        bounds->setBounds(-s.limit, s.limit);
        inverse.addActuationTask(*bounds, 1.0, 0, 0.0);
        for (size_t n = 0; n < s.soles.size(); n++) {
            if (held[4 * n] == 0.0) continue;
            const Matrix corners = Eigen::Map<const Matrix>(s.corners.col(n).data(), 3, 4);
            const Vector bears = loaded.segment(4 * n, 4);
            soles.emplace_back(n, std::make_shared<Sole>(s.soles[n], robot, corners, s.mu, bears));
            inverse.addRigidContact(*soles.back().second, s.force - REGULARISATION, 1.0, 0);
        }
        for (size_t k = 0; k < s.contacts.size(); k++) {
            if (held[k] == 0.0) {
                swinging.emplace_back(k, task(s.contacts[k], s.contacts[k], {1, 1, 1, 0, 0, 0}, s.swing));
            } else if (s.soles.empty()) {
                points.emplace_back(k, std::make_shared<Point>(s.contacts[k], robot, s.mu));
                inverse.addRigidContact(*points.back().second, s.force - REGULARISATION, 1.0, 0);
            }
        }
        for (const auto &name : s.thrusters) {
            thrusters.push_back(std::make_shared<FreeForce>(name, robot));
            inverse.addRigidContact(*thrusters.back(), s.thrust - REGULARISATION, 0.0, 1);
        }
        solver.resize(inverse.nVar(), inverse.nEq(), inverse.nIn());
    }

    std::shared_ptr<tasks::TaskSE3Equality> task(const std::string &name, const std::string &frame,
                                                 const std::array<long, 6> &axes, double weight)
    {
        auto made = std::make_shared<tasks::TaskSE3Equality>(name, robot, frame);
        Vector mask(6);
        for (long i = 0; i < 6; i++) mask[i] = axes[i];
        made->Kp(Vector::Zero(6));
        made->Kd(Vector::Zero(6));
        made->setMask(mask);
        made->useLocalFrame(false);
        inverse.addMotionTask(*made, weight, 1, 0.0);
        frames.push_back(made);
        return made;
    }

    std::shared_ptr<tasks::TaskJointPosture> posture(const std::string &name, const Vector &mask, double weight)
    {
        auto made = std::make_shared<tasks::TaskJointPosture>(name, robot);
        made->setMask(mask);
        made->Kp(Vector::Zero(mask.size()));
        made->Kd(Vector::Zero(mask.size()));
        inverse.addMotionTask(*made, weight, 1, 0.0);
        return made;
    }
};

using Clock = std::chrono::steady_clock;

struct Replay {
    const Settings &s;
    std::vector<Formulation *> at;  // of each tick: one for each set of feet, so that switching costs nothing
    std::map<std::vector<double>, std::unique_ptr<Formulation>> formulations;
    Sample sample = frame_sample(), joints, centre;
    Vector target = Vector::Zero(6), scaled, q, v, lower, upper, torque;
    double tick = 0.0;

    explicit Replay(const Settings &settings)
        : s(settings), joints(s.limit.size(), s.limit.size()), centre(3, 3)
    {
        joints.setValue(Vector::Zero(s.limit.size()));
        for (long i = 0; i < s.ticks; i++) {
            const Vector held = s.held.col(i), loaded = s.loaded.col(i);
            std::vector<double> key(held.data(), held.data() + held.size());
            key.insert(key.end(), loaded.data(), loaded.data() + loaded.size());
            auto &made = formulations[key];
            if (!made) made = std::make_unique<Formulation>(s, held, loaded);
            at.push_back(made.get());
        }
    }

    Sample &linear(const Matrix &targets, long row, long i)
    {
        target.head<3>() = targets.col(i).segment<3>(row);
        target.tail<3>().setZero();
        sample.setSecondDerivative(target);
        return sample;
    }

    void set_targets(Formulation &f, long i)
    {
        f.body->setReference(linear(s.body_target, 0, i));
        if (f.centre) {
            centre.setSecondDerivative(s.body_target.col(i));
            f.centre->setReference(centre);
        }
        target.head<3>().setZero();
        target.tail<3>() = s.orientation_target.col(i);
        sample.setSecondDerivative(target);
        f.orientation->setReference(sample);
        for (auto &[factor, task] : f.postures) {
            scaled = factor * s.joint_target.col(i);
            joints.setSecondDerivative(scaled);
            task->setReference(joints);
        }
        for (auto &[j, task] : f.brakes) {
            joints.setSecondDerivative(s.joint_target.col(i));
            task->setReference(joints);
            f.inverse.updateTaskWeight(task->name(), s.brake(j, i));
        }
        for (auto &[k, task] : f.swinging) task->setReference(linear(s.feet_target, 3 * k, i));
        for (auto &[k, point] : f.points) point->aim(linear(s.feet_target, 3 * k, i));
        for (auto &[n, sole] : f.soles) {
            target = s.sole_target.col(i).segment<6>(6 * n);
            sample.setSecondDerivative(target);
            sole->aim(sample);
        }
        lower = -s.limit - s.resistance.col(i);
        upper = s.limit - s.resistance.col(i);
        f.bounds->setBounds(lower, upper);
    }

    const solvers::HQPOutput &step(long i)
    {
        const auto begin = Clock::now();
        Formulation &f = *at[i];
        q = s.q.col(i);
        v = s.v.col(i);
        set_targets(f, i);
        const auto &solution = f.solver.solve(f.inverse.computeProblemData(0.0, q, v));
        torque = f.inverse.getActuatorForces(solution) + s.resistance.col(i);
        tick = double(std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - begin).count());
        return solution;
    }
};

static void write(std::ostream &out, const Vector &x)
{
    out.write(reinterpret_cast<const char *>(x.data()), sizeof(double) * x.size());
}

// Acceleration, torque, forces and thrusts of a tick; no numbers where it was not solved.
static Vector solution_of(Replay &replay, long i)
{
    const Settings &s = replay.s;
    const long nv = s.model.nv, points = s.contacts.size(), thrusters = s.thrusters.size();
    const auto &solution = replay.step(i);
    Formulation &f = *replay.at[i];
    Vector row = Vector::Zero(2 * nv - 6 + 3 * (points + thrusters));
    if (solution.status != solvers::HQP_STATUS_OPTIMAL) {
        row.setConstant(std::numeric_limits<double>::quiet_NaN());
        return row;
    }
    row.head(nv) = f.inverse.getAccelerations(solution);
    row.segment(nv, nv - 6) = replay.torque;
    const long at = 2 * nv - 6;
    for (auto &[k, point] : f.points) row.segment<3>(at + 3 * k) = f.inverse.getContactForces(point->name(), solution);
    for (auto &[n, sole] : f.soles) row.segment<12>(at + 12 * n) = f.inverse.getContactForces(sole->name(), solution);
    for (long k = 0; k < thrusters; k++)
        row.segment<3>(at + 3 * (points + k)) = f.inverse.getContactForces(s.thrusters[k], solution);
    return row;
}

int main(int count, char **argument)
{
    if (count != 4) return 2;
    const Settings s = load(argument[1], argument[2]);
    Replay replay(s);
    std::ofstream out(argument[3], std::ios::binary);
    for (long i = 0; i < s.ticks; i++) write(out, solution_of(replay, i));
    const long joints = s.limit.size();
    for (long k = 0; k < s.repetitions; k++) {  // times of all ticks, then torques
        Vector tick(s.ticks), torque(s.ticks * joints);
        for (long i = 0; i < s.ticks; i++) {
            const bool solved = replay.step(i).status == solvers::HQP_STATUS_OPTIMAL;
            tick[i] = replay.tick;
            torque.segment(i * joints, joints) = replay.torque;
            if (!solved) torque.segment(i * joints, joints).setConstant(std::numeric_limits<double>::quiet_NaN());
        }
        write(out, tick);
        write(out, torque);
    }
    return out.good() ? 0 : 3;
}
