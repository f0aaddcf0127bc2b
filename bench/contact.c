/*
 * contact: the cost of contact in a step of backward Euler. A square sheet of 1 m, folded like an accordion,
 * lies on a floor and collapses: after the first steps all layers touch. Prints the wall time of a step and
 * the share of its stages, at the thickness of CS184 and at a tenth of it.
 *
 *     contact [--csv FILE] [--steps WARM COUNT] [NODES A SIDE ...]      default 6 4, 20 50 100
 */
#include "bench.h"

#include "contact/contact.h"

#define FLAT 0.1 /* [m] length of the flat part between two turns */

static int warm = 6; /* steps before the measured ones */
static int steps = 4;

/* The point at arc length s of the accordion, from the floor up: flat parts of length FLAT joined by turns of
 * radius r. */
static void fold(double s, double r, double lowest, double *x, double *y)
{
    double turn = acos(-1) * r, period = FLAT + turn, layer = floor(s / period), along = s - layer * period;
    double sign = fmod(layer, 2) > 0 ? -1 : 1;
    *y = lowest + 2 * r * layer;
    *x = sign * (fmin(along, FLAT) - FLAT / 2);
    if (along > FLAT) {
        double angle = (along - FLAT) / r;
        *x = sign * (FLAT / 2 + r * sin(angle));
        *y += r * (1 - cos(angle));
    }
}

static void lay(drape_context *ctx, drape_sim *sim, int side, double r, double lowest)
{
    size_t nodes = (size_t)side * (size_t)side;
    double *x = calloc(3 * nodes, sizeof *x), *v = calloc(3 * nodes, sizeof *v);
    if (!x || !v)
        exit(1);
    for (size_t i = 0; i < nodes; i++) {
        fold((double)(i / (size_t)side) / (side - 1), r, lowest, &x[3 * i], &x[3 * i + 1]);
        x[3 * i + 2] = (double)(i % (size_t)side) / (side - 1);
    }
    if (drape_sim_set_state(sim, 0, x, v))
        bench_fail(ctx, "the folds");
    free(x);
    free(v);
}

static void advance(drape_context *ctx, drape_sim *sim, int count)
{
    if (drape_sim_advance(sim, drape_sim_time(sim) + count / 60.0))
        bench_fail(ctx, "a step");
}

typedef struct stages {
    double step, contact, search, factor;
    int64_t iterations;
} stages;

static stages read_stages(const drape_sim *sim)
{
    drape_statistics s = drape_sim_statistics(sim);
    return (stages){.step = s.wall_steps,
                    .contact = s.wall_contact,
                    .search = drape_contact_search_seconds(drape_system_contact(sim->system)),
                    .factor = s.wall_factor,
                    .iterations = s.newton_iterations};
}

static void measure(drape_context *ctx, int side, double thickness, double friction, FILE *csv)
{
    double r = fmax(1.1 * thickness, 1.1 / (side - 1)), least;
    drape_model *model = bench_model(
        ctx,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': %d, 'rows': %d, 'width': 1, 'height': "
        "1}, "
        "'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge', "
        "'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 1e-3}]}], 'colliders': [{'type': 'plane', "
        "'point': "
        "[0, 0, 0], 'normal': [0, 1, 0], 'friction': %g}], 'self_contact': {'thickness': %g, 'friction': "
        "%g}, "
        "'duration': 1}",
        side, side, friction, thickness, friction);
    drape_sim *sim = bench_sim(ctx, model, "be", NULL, NULL, NULL);
    lay(ctx, sim, side, r, 0.0015);
    advance(ctx, sim, warm);
    stages a = read_stages(sim);
    advance(ctx, sim, steps);
    stages b = read_stages(sim);
    int32_t active = drape_contact_active(drape_system_contact(sim->system), &least);
    double step = b.step - a.step;
    printf("%6d %10g %8g %8d %10.1f %6.1f %10.1f %8.1f %8.1f\n", side * side, thickness, friction,
           (int)active, 1e3 * step / steps, (double)(b.iterations - a.iterations) / steps,
           100 * (b.contact - a.contact) / step, 100 * (b.search - a.search) / step,
           100 * (b.factor - a.factor) / step);
    fflush(stdout);
    if (csv) {
        bench_csv_row(csv);
        fprintf(csv, "%d,%g,%g,%d,%g,%g,%g,%g,%g\n", side * side, thickness, friction, (int)active,
                1e3 * step / steps, (double)(b.iterations - a.iterations) / steps,
                100 * (b.contact - a.contact) / step, 100 * (b.search - a.search) / step,
                100 * (b.factor - a.factor) / step);
    }
    drape_sim_destroy(&sim);
    drape_model_destroy(&model);
}

int main(int argc, char **argv)
{
    const char *file = NULL;
    int sides[16] = {20, 50, 100}, count = 3, first = 1;
    if (argc > 1 && strcmp(argv[1], "--help") == 0)
        return puts("contact [--csv FILE] [--steps WARM COUNT] [NODES A SIDE ...]") < 0;
    if (argc > first + 1 && strcmp(argv[first], "--csv") == 0) {
        file = argv[first + 1];
        first += 2;
    }
    if (argc > first + 2 && strcmp(argv[first], "--steps") == 0) {
        warm = atoi(argv[first + 1]);
        steps = atoi(argv[first + 2]);
        first += 3;
    }
    for (int i = first; i < argc && i - first < 16; i++) {
        sides[i - first] = atoi(argv[i]);
        count = i - first + 1;
    }
    if (warm < 0 || steps < 1) {
        fputs("contact: WARM is at least 0, COUNT at least 1\n", stderr);
        return 2;
    }
    FILE *csv = bench_csv(file, "nodes,thickness_m,friction,active_pairs,step_ms,iterations,contact_percent,"
                                "search_percent,factor_percent");
    drape_context *ctx = bench_context();
    puts(" nodes  thickness friction   active    step ms  iter.  contact %  search %  factor %");
    for (int i = 0; i < count; i++)
        for (int k = 0; k < 4; k++)
            measure(ctx, sides[i], k % 2 ? 0.00095 : 0.0095, k / 2 ? 0.3 : 0, csv);
    drape_context_destroy(&ctx);
    return csv && fclose(csv) ? 1 : 0;
}
