// Replays recorded states through TSID's C++ library, without Python: tsid_cpp_worker.py compiles and calls it.
//
//     tsid_driver HEADER DATA RESULT
//
// Thrusts that are given are measured forces, which TSID has since 1.8. One that is decided is a point contact whose
// normal is the zero vector, which empties its friction rows and leaves a free force; its motion task counts nothing.
// The solver adds REGULARISATION to the Hessian's diagonal and has no switch for it: the weights of forces and posture
// are lowered by as much, so that the sum is the program's. It pulls accelerations to zero: with gains of the posture
// raised as much, weight times target stays the same.
// HEADER is text, DATA and RESULT are float64 in the order in which they are read and written below.

#include <tsid/contacts/contact-point.hpp>
#include <tsid/contacts/measured-3d-force.hpp>
#include <tsid/formulations/inverse-dynamics-formulation-acc-force.hpp>
#include <tsid/robots/robot-wrapper.hpp>
#include <tsid/solvers/solver-HQP-eiquadprog-fast.hpp>
#include <tsid/tasks/task-actuation-bounds.hpp>
#include <tsid/tasks/task-joint-posture.hpp>
#include <tsid/tasks/task-se3-equality.hpp>

#include <pinocchio/algorithm/compute-all-terms.hpp>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/parsers/urdf.hpp>

#include <chrono>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <set>

using namespace tsid;
using Vector = Eigen::VectorXd;
using Sample = trajectories::TrajectorySample;

const double REGULARISATION = 1e-8;  // TSID's DEFAULT_HESSIAN_REGULARIZATION
const double FREE = 1e4;             // a bound that no force reaches, N

struct Settings {
    std::string urdf, base;
    std::vector<std::string> feet, thrusters;
    long ticks, repetitions, given;
    double mu, body, orientation, swing, thrust, force, contact;
    double orientation_gains[2], posture_gains[2];
    pinocchio::Model model;
    Vector limit, rest, weights;  // of each joint
    Eigen::MatrixXd q, v, body_target, feet_target, held, thrusts, damping;  // a column for each tick
};

static Eigen::MatrixXd read(std::istream &in, long rows, long columns)
{
    Eigen::MatrixXd out(rows, columns);
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
    text >> s.base >> s.ticks >> s.repetitions >> s.given >> s.mu;
    text >> s.body >> s.orientation >> s.swing >> s.thrust >> s.force >> s.contact;
    text >> s.orientation_gains[0] >> s.orientation_gains[1] >> s.posture_gains[0] >> s.posture_gains[1];
    s.feet = names(text);
    s.thrusters = names(text);
    if (!text) throw std::runtime_error("HEADER is too short");
    pinocchio::urdf::buildModel(s.urdf, pinocchio::JointModelFreeFlyer(), s.model);
    const long nv = s.model.nv, joints = nv - 6, n = s.ticks;
    s.model.armature = read(raw, nv, 1);
    s.limit = read(raw, joints, 1);
    s.rest = read(raw, joints, 1);
    s.weights = read(raw, joints, 1);
    s.q = read(raw, s.model.nq, n);
    s.v = read(raw, nv, n);
    s.body_target = read(raw, 3, n);
    s.feet_target = read(raw, 3 * s.feet.size(), n);
    s.held = read(raw, s.feet.size(), n);
    s.thrusts = read(raw, 3 * s.thrusters.size(), n);
    s.damping = read(raw, nv, n).bottomRows(joints);
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

// TSID's formulation and solver for one set of held feet.
struct Formulation {
    robots::RobotWrapper robot;
    InverseDynamicsFormulationAccForce inverse;
    solvers::SolverHQuadProgFast solver;
    std::vector<std::shared_ptr<tasks::TaskSE3Equality>> frames;
    std::vector<std::pair<long, std::shared_ptr<tasks::TaskSE3Equality>>> swinging;
    std::vector<std::shared_ptr<contacts::ContactPoint>> contacts;
    std::vector<std::shared_ptr<contacts::Measured3Dforce>> measured;
    std::vector<std::shared_ptr<tasks::TaskJointPosture>> postures;
    std::shared_ptr<tasks::TaskActuationBounds> bounds;
    std::shared_ptr<tasks::TaskSE3Equality> body;

    Formulation(const Settings &s, const Vector &held)
        : robot(s.model, false), inverse("tsid", robot, false), solver("solver")
    {
        const double zero[2] = {0.0, 0.0};
        inverse.computeProblemData(0.0, pinocchio::neutral(s.model), Vector::Zero(s.model.nv));
        body = task("body", s.base, true, zero, s.body);
        Sample level = frame_sample();
        task("orientation", s.base, false, s.orientation_gains, s.orientation)->setReference(level);

        Sample rest(s.rest.size());
        rest.setValue(s.rest);
        for (const double full : std::set<double>(s.weights.begin(), s.weights.end())) {
            const double weight = full - REGULARISATION, raised = full / weight;
            postures.push_back(std::make_shared<tasks::TaskJointPosture>("posture " + std::to_string(full), robot));
            postures.back()->setMask((s.weights.array() == full).cast<double>());
            postures.back()->Kp(Vector::Constant(s.rest.size(), s.posture_gains[0] * raised));
            postures.back()->Kd(Vector::Constant(s.rest.size(), s.posture_gains[1] * raised));
            postures.back()->setReference(rest);
            inverse.addMotionTask(*postures.back(), weight, 1, 0.0);
        }
        bounds = std::make_shared<tasks::TaskActuationBounds>("torque", robot);
        bounds->setBounds(-s.limit, s.limit);
        inverse.addActuationTask(*bounds, 1.0, 0, 0.0);

        const Eigen::Vector3d up(0.0, 0.0, 1.0);
        for (size_t k = 0; k < s.feet.size(); k++) {
            if (held[k] != 0.0)
                contact(s.feet[k], up, s.mu, 0.0, s.force, true, s.contact);
            else
                swinging.emplace_back(k, task(s.feet[k], s.feet[k], true, zero, s.swing));
        }
        for (const auto &name : s.thrusters) {
            if (!s.given) {
                contact(name, Eigen::Vector3d::Zero(), 1.0, -FREE, s.thrust, false, 0.0);
                continue;
            }
            measured.push_back(std::make_shared<contacts::Measured3Dforce>(name, robot, name));
            measured.back()->useLocalFrame(false);
            inverse.addMeasuredForce(*measured.back());
        }
        solver.resize(inverse.nVar(), inverse.nEq(), inverse.nIn());
    }

    std::shared_ptr<tasks::TaskSE3Equality> task(const std::string &name, const std::string &frame, bool linear,
                                                 const double *gains, double weight)
    {
        auto made = std::make_shared<tasks::TaskSE3Equality>(name, robot, frame);
        Vector mask = Vector::Zero(6);
        mask.segment(linear ? 0 : 3, 3).setOnes();
        made->Kp(Vector::Constant(6, gains[0]));
        made->Kd(Vector::Constant(6, gains[1]));
        made->setMask(mask);
        made->useLocalFrame(false);
        inverse.addMotionTask(*made, weight, 1, 0.0);
        frames.push_back(made);
        return made;
    }

    void contact(const std::string &name, const Eigen::Vector3d &normal, double mu, double least, double weight,
                 bool hard, double damping)
    {
        auto made = std::make_shared<contacts::ContactPoint>(name, robot, name, normal, mu, least, FREE);
        Vector ones = Vector::Ones(3);
        made->Kp(Vector::Zero(3));
        made->Kd(Vector::Constant(3, damping));
        made->setReference(pinocchio::SE3::Identity());
        made->useLocalFrame(false);
        made->setRegularizationTaskWeightVector(ones);
        inverse.addRigidContact(*made, weight - REGULARISATION, hard ? 1.0 : 0.0, hard ? 0 : 1);
        contacts.push_back(made);
    }
};

using Clock = std::chrono::steady_clock;

static double nanoseconds(Clock::time_point from, Clock::time_point to)
{
    return double(std::chrono::duration_cast<std::chrono::nanoseconds>(to - from).count());
}

struct Replay {
    const Settings &s;
    std::vector<Formulation *> at;  // of each tick: one for each set of held feet, so that switching costs nothing
    std::map<std::vector<double>, std::unique_ptr<Formulation>> formulations;
    Sample sample = frame_sample();
    Vector target = Vector::Zero(6), q, v, lower, upper, torque;
    double tick = 0.0, solve = 0.0;

    explicit Replay(const Settings &settings) : s(settings)
    {
        for (long i = 0; i < s.ticks; i++) {
            const Vector held = s.held.col(i);
            auto &made = formulations[std::vector<double>(held.data(), held.data() + held.size())];
            if (!made) made = std::make_unique<Formulation>(s, held);
            at.push_back(made.get());
        }
    }

    void aim(tasks::TaskSE3Equality &task, const Eigen::MatrixXd &targets, long row, long i)
    {
        target.head<3>() = targets.col(i).segment<3>(row);
        sample.setSecondDerivative(target);
        task.setReference(sample);
    }

    const solvers::HQPOutput &step(long i)
    {
        const auto t0 = Clock::now();
        Formulation &f = *at[i];
        q = s.q.col(i);
        v = s.v.col(i);
        aim(*f.body, s.body_target, 0, i);
        for (auto &[k, task] : f.swinging) aim(*task, s.feet_target, 3 * k, i);
        lower = -s.limit - s.damping.col(i);
        upper = s.limit - s.damping.col(i);
        f.bounds->setBounds(lower, upper);
        for (size_t k = 0; k < f.measured.size(); k++)
            f.measured[k]->setMeasuredContactForce(s.thrusts.col(i).segment<3>(3 * k));
        const auto &program = f.inverse.computeProblemData(0.0, q, v);
        const auto t1 = Clock::now();
        const auto &solution = f.solver.solve(program);
        const auto t2 = Clock::now();
        torque = f.inverse.getActuatorForces(solution) + s.damping.col(i);
        tick = nanoseconds(t0, Clock::now());
        solve = nanoseconds(t1, t2);
        return solution;
    }
};

// Pinocchio's rigid-body terms of the program, without Python: what they cost, ns.
struct Terms {
    const Settings &s;
    pinocchio::Data data;
    std::vector<pinocchio::FrameIndex> frames;
    Vector zero, q, v, drift;
    std::vector<pinocchio::Data::Matrix6x> jacobian;

    explicit Terms(const Settings &settings) : s(settings), data(s.model), zero(Vector::Zero(s.model.nv))
    {
        for (const auto *names : {&s.feet, &s.thrusters})
            for (const auto &name : *names) frames.push_back(s.model.getFrameId(name));
        jacobian.assign(frames.size(), pinocchio::Data::Matrix6x::Zero(6, s.model.nv));
        drift = Vector::Zero(6 * s.feet.size());
    }

    double time(long i)
    {
        const auto world = pinocchio::LOCAL_WORLD_ALIGNED;
        const auto t0 = Clock::now();
        q = s.q.col(i);
        v = s.v.col(i);
        pinocchio::computeAllTerms(s.model, data, q, v);
        pinocchio::forwardKinematics(s.model, data, q, v, zero);
        pinocchio::updateFramePlacements(s.model, data);
        for (size_t k = 0; k < frames.size(); k++)
            pinocchio::getFrameJacobian(s.model, data, frames[k], world, jacobian[k]);
        for (size_t k = 0; k < s.feet.size(); k++) {
            drift.segment<3>(6 * k) =
                pinocchio::getFrameClassicalAcceleration(s.model, data, frames[k], world).linear();
            drift.segment<3>(6 * k + 3) = pinocchio::getFrameVelocity(s.model, data, frames[k], world).linear();
        }
        return nanoseconds(t0, Clock::now());
    }
};

static void write(std::ostream &out, const Vector &x)
{
    out.write(reinterpret_cast<const char *>(x.data()), sizeof(double) * x.size());
}

int main(int count, char **argument)
{
    if (count != 4) return 2;
    const Settings s = load(argument[1], argument[2]);
    Replay replay(s);
    Terms terms(s);
    std::ofstream out(argument[3], std::ios::binary);
    const double nothing = std::numeric_limits<double>::quiet_NaN();
    const long feet = s.feet.size(), thrusters = s.thrusters.size();
    for (long i = 0; i < s.ticks; i++) {  // acceleration, torque, forces and thrusts of every tick
        const auto &solution = replay.step(i);
        Formulation &f = *replay.at[i];
        Vector row = Vector::Zero(2 * s.model.nv - 6 + 3 * (feet + thrusters));
        row.head(s.model.nv) = f.inverse.getAccelerations(solution);
        row.segment(s.model.nv, s.model.nv - 6) = replay.torque;
        double *at = row.data() + 2 * s.model.nv - 6;
        for (long k = 0; k < feet; k++)
            if (s.held(k, i) != 0.0)
                Eigen::Map<Eigen::Vector3d>(at + 3 * k) = f.inverse.getContactForces(s.feet[k], solution);
        for (long k = 0; k < thrusters && !s.given; k++)
            Eigen::Map<Eigen::Vector3d>(at + 3 * (feet + k)) = f.inverse.getContactForces(s.thrusters[k], solution);
        if (solution.status != solvers::HQP_STATUS_OPTIMAL) row.setConstant(nothing);
        write(out, row);
    }
    for (long k = 0; k < s.repetitions; k++) {  // times of ticks, solves and terms, torques; of every repetition
        Vector tick(s.ticks), solve(s.ticks), term(s.ticks), torque(s.ticks * s.limit.size());
        for (long i = 0; i < s.ticks; i++) {
            const bool solved = replay.step(i).status == solvers::HQP_STATUS_OPTIMAL;
            tick[i] = replay.tick;
            solve[i] = replay.solve;
            if (solved)
                torque.segment(i * s.limit.size(), s.limit.size()) = replay.torque;
            else
                torque.segment(i * s.limit.size(), s.limit.size()).setConstant(nothing);
        }
        for (long i = 0; i < s.ticks; i++) term[i] = terms.time(i);
        write(out, tick);
        write(out, solve);
        write(out, term);
        write(out, torque);
    }
    return out.good() ? 0 : 3;
}
