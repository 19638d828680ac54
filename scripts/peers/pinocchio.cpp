// Pinocchio: fd = articulated-body algorithm in local frames, fd_world = the same in world frames, fdf = either sweep's accelerations and
// the hinge loads: data.f, which its articulated-body algorithm leaves in the frames of the joints.
#include "protocol.hpp"
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
namespace pin = pinocchio;

struct Pinocchio : Case {
    pin::Model model;
    std::unique_ptr<pin::Data> data;
    Eigen::VectorXd q, v, tau;
    double last = 0;
    int free = 0;

    explicit Pinocchio(const Model& given) {
        using Vector = Eigen::Vector3d;
        const auto vector = [](const std::array<double, 3>& x) { return Vector(x[0], x[1], x[2]); };
        model.gravity.linear() = vector(given.gravity);
        std::vector<pin::JointIndex> joints;
        for (const Link& link : given.links) {
            const auto& w = link.quaternion;
            const pin::SE3 place(Eigen::Quaterniond(w[0], w[1], w[2], w[3]).normalized().toRotationMatrix(), vector(link.position));
            const pin::JointIndex parent = link.parent < 0 ? 0 : joints[static_cast<std::size_t>(link.parent)];
            const std::string name = "joint" + std::to_string(joints.size());
            const Vector axis = vector(link.axis);
            if (link.free) joints.push_back(model.addJoint(parent, pin::JointModelFreeFlyer(), place, name)), free = 1;
            else if (axis == Vector::UnitX()) joints.push_back(model.addJoint(parent, pin::JointModelRX(), place, name));
            else if (axis == Vector::UnitY()) joints.push_back(model.addJoint(parent, pin::JointModelRY(), place, name));
            else if (axis == Vector::UnitZ()) joints.push_back(model.addJoint(parent, pin::JointModelRZ(), place, name));
            else joints.push_back(model.addJoint(parent, pin::JointModelRevoluteUnaligned(axis), place, name));
            const auto& i = link.inertia;
            Eigen::Matrix3d inertia;
            inertia << i[0], i[3], i[4], i[3], i[1], i[5], i[4], i[5], i[2];
            model.appendBodyToJoint(joints.back(), pin::Inertia(link.mass, vector(link.center_of_mass), inertia));
        }
        data = std::make_unique<pin::Data>(model);
        q = pin::neutral(model);
        v = tau = Eigen::VectorXd::Zero(model.nv);
        const auto& h = given.hub_velocity;
        if (free) v.head<6>() << h[3], h[4], h[5], h[0], h[1], h[2];
        // joints are numbered depth first, links are not
        for (std::size_t k = 0; k < joints.size(); ++k) {
            const Link& link = given.links[k];
            order.push_back(joints[k]);
            if (link.free) continue;
            q[model.joints[joints[k]].idx_q()] = link.angle;
            v[model.joints[joints[k]].idx_v()] = link.rate;
            tau[model.joints[joints[k]].idx_v()] = link.torque;
        }
        last = v[model.nv - 1];
    }

    bool call(const std::string& op, int i) override {
        v[model.nv - 1] = last + 1e-12 * i;
        if (op == "fd" || op == "fdf") pin::aba(model, *data, q, v, tau, pin::Convention::LOCAL);
        else if (op == "fd_world") pin::aba(model, *data, q, v, tau, pin::Convention::WORLD);
        else return false;
        return true;
    }

    std::vector<double> accelerations() const override {
        std::vector<double> out;
        for (auto joint : order)
            if (model.joints[joint].nv() == 1) out.push_back(data->ddq[model.joints[joint].idx_v()]);
        return out;
    }

    std::vector<double> loads() const override {
        std::vector<double> out;
        for (auto joint : order) {
            for (double x : data->f[joint].angular()) out.push_back(x);
            for (double x : data->f[joint].linear()) out.push_back(x);
        }
        return out;
    }

private:
    std::vector<pin::JointIndex> order;
};

int main() { return serve<Pinocchio>(); }
