// What the C++ drivers share: model files (see models.py), and the line protocol.
//
// Request "<model file> <n> <op> <seconds>" -> "<least ns per call> <median ns> <check>", numbers for an op that asks for them, or
// "skip". Time is CPU time of the thread; a batch takes at least half a millisecond.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <iostream>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

struct Link {
    int parent;
    bool free;
    std::array<double, 3> axis, position;
    std::array<double, 4> quaternion;
    double mass;
    std::array<double, 3> center_of_mass;
    std::array<double, 6> inertia;  // xx yy zz xy xz yz
    double angle, rate, torque;
};

struct Model {
    std::array<double, 3> gravity;
    std::array<double, 6> hub_velocity;  // angular, linear
    std::vector<Link> links;
};

inline Model read_model(const std::string& path) {
    std::ifstream file(path);
    if (!file) throw std::runtime_error("cannot read " + path);
    Model model;
    for (double& x : model.gravity) file >> x;
    for (double& x : model.hub_velocity) file >> x;
    double parent, free;
    while (file >> parent >> free) {
        Link link;
        link.parent = static_cast<int>(parent);
        link.free = free != 0;
        for (double& x : link.axis) file >> x;
        for (double& x : link.position) file >> x;
        for (double& x : link.quaternion) file >> x;
        file >> link.mass;
        for (double& x : link.center_of_mass) file >> x;
        for (double& x : link.inertia) file >> x;
        file >> link.angle >> link.rate >> link.torque;
        model.links.push_back(link);
    }
    return model;
}

// One model in one engine.
struct Case {
    virtual ~Case() = default;
    virtual bool call(const std::string& op, int i) = 0;    // one evaluation; false: no such op
    virtual std::vector<double> accelerations() const = 0;  // of the revolute hinges, from the last call
    virtual std::vector<double> loads() const { return {}; }  // six per link: moment, force; from the last call of fdf
};

inline double thread_seconds() {
    timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

inline std::string numbers(const std::vector<double>& values) {
    std::ostringstream out;
    out.precision(17);
    for (double x : values) out << x << ' ';
    return values.empty() ? "skip" : out.str();
}

inline std::string answer(Case& c, const std::string& op, double seconds) {
    if (op == "accelerations") return c.call("fd", 0), numbers(c.accelerations());
    if (op == "loads") return c.call("fdf", 0) ? numbers(c.loads()) : "skip";
    if (!c.call(op, 0)) return "skip";
    double check = 0, spent = 0;
    for (double a : c.accelerations()) check += std::fabs(a);
    std::vector<double> times;
    for (long batch = 1; spent < seconds || times.size() < 3;) {
        const double start = thread_seconds();
        for (long i = 0; i < batch; ++i) c.call(op, static_cast<int>(i & 7));
        const double taken = thread_seconds() - start;
        spent += taken;
        if (taken < 5e-4 && times.empty()) batch *= 2;
        else times.push_back(1e9 * taken / static_cast<double>(batch));
    }
    std::sort(times.begin(), times.end());
    return numbers({times.front(), times[times.size() / 2], check});
}

template <class Engine> int serve() {
    std::string path, n, op, held;
    double seconds;
    std::unique_ptr<Case> c;
    while (std::cin >> path >> n >> op >> seconds) {
        try {
            if (held != path) c.reset(), c = std::make_unique<Engine>(read_model(path)), held = path;
            std::cout << answer(*c, op, seconds) << std::endl;
        } catch (const std::exception& error) {
            std::cerr << error.what() << '\n';
            held.clear();
            std::cout << "skip" << std::endl;
        }
    }
    return 0;
}
