// host.cpp: a flag in gusts that this program makes, on a pole that it moves; prints the force on the pole. Build and run:
//     cmake -S . -B build && cmake --build build && build/host [FRAMES]
#include <drape/drape.h>

#include <cmath>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <vector>

template <class T, void (*destroy)(T **)> struct Release {
    void operator()(T *object) const { destroy(&object); }
};
using Context = std::unique_ptr<drape_context, Release<drape_context, drape_context_destroy>>;
using Scene = std::unique_ptr<drape_scene, Release<drape_scene, drape_scene_destroy>>;
using Model = std::unique_ptr<drape_model, Release<drape_model, drape_model_destroy>>;
using Sim = std::unique_ptr<drape_sim, Release<drape_sim, drape_sim_destroy>>;

// A gust that travels along x: w = w0 (1 + 1/2 sin(k x - c t)), with its derivative for Newton's method.
extern "C" void gust(void *user, double t, int32_t count, const double *x, double *wind, double *gradient)
{
    const double w0 = *static_cast<const double *>(user), k = 4, c = 12;
    for (int32_t i = 0; i < count; i++) {
        wind[3 * i] = w0 * (1 + 0.5 * std::sin(k * x[3 * i] - c * t));
        if (gradient) gradient[9 * i] = w0 * 0.5 * k * std::cos(k * x[3 * i] - c * t);
    }
}

int main(int argc, char **argv)
try {
    static const char text[] = R"({"drape": 1, "cloth": [{
        "mesh": {"grid": "square", "columns": 25, "rows": 16, "width": 1.2, "height": 0.75, "orientation": "vertical"},
        "material": {"young_modulus": 1e5, "thickness": 5e-4, "density": 300},
        "terms": ["stretch.edge", "bend.hinge", "drag.wind"], "pins": [{"edge": "left"}]}], "duration": 5})";
    const int frames = argc > 1 ? std::atoi(argv[1]) : 300;
    const double frame = 1.0 / 60;
    double w0 = 6;

    drape_context *made = nullptr;
    if (drape_context_create(nullptr, &made)) throw std::bad_alloc();
    Context ctx(made);
    auto check = [&](drape_status status) {
        if (status) throw std::runtime_error(drape_context_message(ctx.get()));
    };
    auto make = [&](auto function, auto &out, auto... arguments) {
        typename std::decay_t<decltype(out)>::pointer raw = nullptr;
        check(function(arguments..., &raw));
        out.reset(raw);
    };
    Scene scene;
    Model model;
    Sim sim;
    make(drape_scene_parse, scene, ctx.get(), text, "flag");
    make(drape_scene_compile, model, scene.get());
    make(drape_sim_create, sim, ctx.get(), model.get(), nullptr);
    check(drape_sim_set_wind(sim.get(), gust, &w0));

    const int32_t nodes = drape_model_node_count(model.get());
    const double *rest = drape_model_rest_positions(model.get());
    std::vector<int32_t> pole;
    for (int32_t i = 0; i < nodes; i++)
        if (drape_model_pinned(model.get())[i]) pole.push_back(i);
    std::vector<double> to(3 * pole.size()), speed(3 * pole.size()), forces(3 * static_cast<size_t>(nodes));
    for (int f = 1; f <= frames; f++) {
        const double t = f * frame, a = 0.2, w = 2; // the pole sways along z
        for (size_t i = 0; i < pole.size(); i++) {
            for (size_t k = 0; k < 3; k++) to[3 * i + k] = rest[3 * static_cast<size_t>(pole[i]) + k];
            to[3 * i + 2] += a * std::sin(w * t);
            speed[3 * i + 2] = a * w * std::cos(w * t);
        }
        check(drape_sim_move_pins(sim.get(), static_cast<int32_t>(pole.size()), pole.data(), frame, to.data(), speed.data()));
        check(drape_sim_advance(sim.get(), t));
        if (f % 30) continue;
        check(drape_sim_reactions(sim.get(), forces.data()));
        double sum[3] = {0, 0, 0};
        for (size_t i = 0; i < forces.size(); i++) sum[i % 3] += forces[i];
        std::cout << "t " << t << " s: the pole holds (" << sum[0] << " " << sum[1] << " " << sum[2] << ") N\n";
    }
    return 0;
} catch (const std::exception &e) {
    std::cerr << e.what() << '\n';
    return 1;
}
