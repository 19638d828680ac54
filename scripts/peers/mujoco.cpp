// MuJoCo, its smooth dynamics alone: no contacts, constraints, actuators or sensors.
// fd = kinematics, composite inertias, factorised mass matrix, bias forces, solve; fdf = fd and the interaction forces of all bodies.
#include "protocol.hpp"
#include <mujoco/mujoco.h>

struct MuJoCo : Case {
    mjModel* model = nullptr;
    mjData* data = nullptr;
    std::vector<Link> links;
    std::vector<int> body;  // by link
    int hub = 0;
    double last = 0;

    explicit MuJoCo(const Model& given) : links(given.links) {
        mjSpec* spec = mj_makeSpec();
        for (int k = 0; k < 3; ++k) spec->option.gravity[k] = given.gravity[k];
        spec->option.disableflags = mjDSBL_CONSTRAINT | mjDSBL_CONTACT | mjDSBL_ACTUATION | mjDSBL_SENSOR;
        std::vector<mjsBody*> made;
        for (const Link& link : links) {
            mjsBody* b = mjs_addBody(link.parent < 0 ? mjs_findBody(spec, "world") : made[static_cast<std::size_t>(link.parent)], nullptr);
            mjs_setName(b->element, std::to_string(made.size()).c_str());
            made.push_back(b);
            for (int k = 0; k < 3; ++k) b->pos[k] = link.position[k], b->ipos[k] = link.center_of_mass[k];
            for (int k = 0; k < 4; ++k) b->quat[k] = link.quaternion[k];
            const bool principal = link.inertia[3] == 0 && link.inertia[4] == 0 && link.inertia[5] == 0;
            for (int k = 0; k < 3 && principal; ++k) b->inertia[k] = link.inertia[k];
            for (int k = 0; k < 6 && !principal; ++k) b->fullinertia[k] = link.inertia[k];
            b->mass = link.mass;
            b->explicitinertial = 1;
            mjsJoint* joint = mjs_addJoint(b, nullptr);
            joint->type = link.free ? mjJNT_FREE : mjJNT_HINGE;
            for (int k = 0; k < 3; ++k) joint->axis[k] = link.axis[k];
            hub |= link.free;
        }
        model = mj_compile(spec, nullptr);
        const std::string problem = model ? "" : mjs_getError(spec);
        mj_deleteSpec(spec);
        if (!model) throw std::runtime_error("mujoco: " + problem);
        data = mj_makeData(model);
        for (int k = 0; k < 3 && hub; ++k) data->qvel[k] = given.hub_velocity[3 + k], data->qvel[3 + k] = given.hub_velocity[k];
        for (std::size_t k = 0; k < links.size(); ++k) {
            body.push_back(mj_name2id(model, mjOBJ_BODY, std::to_string(k).c_str()));
            if (links[k].free) continue;
            const int joint = model->body_jntadr[body[k]], rate = model->jnt_dofadr[joint];
            data->qpos[model->jnt_qposadr[joint]] = links[k].angle;
            data->qvel[rate] = links[k].rate;
            data->qfrc_applied[rate] = links[k].torque;
        }
        last = data->qvel[model->nv - 1];
    }
    ~MuJoCo() override { mj_deleteData(data), mj_deleteModel(model); }

    bool call(const std::string& op, int i) override {
        if (op != "fd" && op != "fdf") return false;
        mjModel* m = model;
        mjData* d = data;
        d->qvel[m->nv - 1] = last + 1e-12 * i;
        mj_kinematics(m, d);
        mj_comPos(m, d);
        mj_makeM(m, d);
        mj_factorM(m, d);
        mj_comVel(m, d);
        mj_rne(m, d, 0, d->qfrc_bias);
        for (int k = 0; k < m->nv; ++k) d->qacc[k] = d->qfrc_applied[k] - d->qfrc_bias[k];
        mj_solveM(m, d, d->qacc, d->qacc, 1);
        if (op == "fdf") mj_rnePostConstraint(m, d);
        return true;
    }

    std::vector<double> accelerations() const override {
        std::vector<double> out;
        for (std::size_t k = 0; k < links.size(); ++k)
            if (!links[k].free) out.push_back(data->qacc[model->jnt_dofadr[model->body_jntadr[body[k]]]]);
        return out;
    }

    // cfrc_int acts at the centre of mass of the whole tree, in inertial axes
    std::vector<double> loads() const override {
        std::vector<double> out;
        for (int b : body) {
            const double *f = data->cfrc_int + 6 * b, *centre = data->subtree_com + 3 * model->body_rootid[b], *at = data->xpos + 3 * b;
            const double *turn = data->xmat + 9 * b, arm[3] = {centre[0] - at[0], centre[1] - at[1], centre[2] - at[2]};
            const double moment[3] = {f[0] + arm[1] * f[5] - arm[2] * f[4], f[1] + arm[2] * f[3] - arm[0] * f[5],
                                      f[2] + arm[0] * f[4] - arm[1] * f[3]};
            for (const double* x : {moment, f + 3})
                for (int k = 0; k < 3; ++k) out.push_back(turn[k] * x[0] + turn[3 + k] * x[1] + turn[6 + k] * x[2]);
        }
        return out;
    }
};

int main() { return serve<MuJoCo>(); }
