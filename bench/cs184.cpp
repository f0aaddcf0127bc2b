/*
 * cs184.cpp: the loops of the CS184 cloth simulator, written anew from docs/springs.md, the course's
 * published skeleton and public versions of the finished program. The reference of the benchmark `verlet`.
 *
 * These parts of the original are kept, because they take its time:
 *   - a std::vector of point masses of 120 bytes each, with three-component vectors of doubles, the start
 *     position and the half-edge that only drawing and reset need, and a std::vector of springs that point at
 *     two masses;
 *   - forces by kind of spring; the length is computed once for the strain and again to normalize the
 *     direction;
 *   - a std::unordered_map from a float, which stands for a box of space, to a std::vector of pointers made
 *     by new: deleted, cleared and filled again in every substep, with one look-up to find the box and one to
 *     add;
 *   - one virtual call for each pair of a point and an object to collide with (pinned2 has no objects);
 *   - the compiler options: those of the rest of the build and no others, as in the original: -O3, plain
 *     x86-64.
 * Where the public versions differ, the cheapest is taken. The key of a box is made of rounded-down quotients
 * (other versions call fmod three times) and is unique while there are fewer than 256 boxes along each axis;
 * with polynomials such as x^3 + y^2 + z, boxes share keys by chance, which costs look-ups and changes which
 * points are pushed apart. Lists are not copied; there is no .at() and there are no exceptions.
 *
 * all_boxes is an addition: the same map, asked for every box within reach, finds the pairs that CS184
 * misses.
 */
#include "cs184.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <vector>

namespace {

struct Vector {
    double x = 0, y = 0, z = 0;
    Vector &operator+=(const Vector &b) { x += b.x, y += b.y, z += b.z; return *this; }
    Vector &operator-=(const Vector &b) { x -= b.x, y -= b.y, z -= b.z; return *this; }
    double norm() const { return std::sqrt(x * x + y * y + z * z); }
    void normalize();
};

Vector operator+(const Vector &a, const Vector &b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vector operator-(const Vector &a, const Vector &b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vector operator*(double c, const Vector &a) { return {c * a.x, c * a.y, c * a.z}; }
Vector operator/(const Vector &a, double c) { return (1 / c) * a; }
inline void Vector::normalize() { *this = *this / norm(); }

struct Point {
    bool pinned;
    Vector start, position, last, forces;
    void *halfedge;
};

enum class Kind { structural, shearing, bending };

struct Spring {
    Point *a, *b;
    double rest;
    Kind kind;
};

struct Object {
    virtual ~Object() = default;
    virtual void collide(Point &point) = 0;
};

constexpr int boxes_along = 256; // a float counts to 256^3

} // namespace

struct cs184 {
    cs184_scene scene;
    bool enabled[3] = {true, true, true};
    std::vector<Point> points;
    std::vector<Spring> springs;
    std::vector<Object *> objects;
    std::unordered_map<float, std::vector<Point *> *> map;

    void join(int row, int column, int to_row, int to_column, Kind kind);
    void build();
    void add_forces();
    void integrate(double h);
    float key(double x, double y, double z) const;
    float hash(const Vector &x) const;
    void forget();
    void build_map();
    void add_corrections(const Point &point, const std::vector<Point *> &box, Vector &sum, int &count) const;
    void collide_own(Point &point);
    void collide_all(Point &point);
    void limit_lengths();
    void simulate();
};

/* ---- Making ---- */

void cs184::join(int row, int column, int to_row, int to_column, Kind kind)
{
    if (to_row < 0 || to_column < 0 || to_column >= scene.side)
        return;
    Point *a = &points[row * scene.side + column], *b = &points[to_row * scene.side + to_column];
    springs.push_back({a, b, (a->position - b->position).norm(), kind});
}

void cs184::build()
{
    for (int row = 0; row < scene.side; row++)
        for (int column = 0; column < scene.side; column++) {
            join(row, column, row, column - 1, Kind::structural);
            join(row, column, row - 1, column, Kind::structural);
            join(row, column, row - 1, column - 1, Kind::shearing);
            join(row, column, row - 1, column + 1, Kind::shearing);
            join(row, column, row, column - 2, Kind::bending);
            join(row, column, row - 2, column, Kind::bending);
        }
}

/* ---- Forces and motion ---- */

void cs184::add_forces()
{
    const Vector external = {0, scene.mass * scene.gravity, 0};
    for (Point &p : points)
        p.forces = external;
    for (Spring &s : springs) {
        if (!enabled[static_cast<int>(s.kind)])
            continue;
        const double ks = s.kind == Kind::bending ? 0.2 * scene.ks : scene.ks;
        Vector along = s.b->position - s.a->position;
        const double stretch = along.norm() - s.rest;
        along.normalize();
        const Vector force = ks * stretch * along;
        s.a->forces += force;
        s.b->forces -= force;
    }
}

void cs184::integrate(double h)
{
    for (Point &p : points) {
        if (p.pinned)
            continue;
        const Vector next =
            p.position + (1 - scene.damping / 100) * (p.position - p.last) + h * h * (p.forces / scene.mass);
        p.last = p.position;
        p.position = next;
    }
}

/* ---- Cloth on cloth ---- */

float cs184::key(double x, double y, double z) const
{
    return static_cast<float>((x * boxes_along + y) * boxes_along + z);
}

float cs184::hash(const Vector &x) const
{
    const double w = 3 * scene.width / scene.side, h = 3 * scene.width / scene.side, t = std::max(w, h);
    return key(std::floor(x.x / w), std::floor(x.y / h), std::floor(x.z / t));
}

void cs184::forget()
{
    for (const auto &entry : map)
        delete entry.second;
    map.clear();
}

void cs184::build_map()
{
    forget();
    for (Point &p : points) {
        const float box = hash(p.position);
        if (map.find(box) == map.end())
            map[box] = new std::vector<Point *>();
        map[box]->push_back(&p);
    }
}

void cs184::add_corrections(const Point &point, const std::vector<Point *> &box, Vector &sum, int &count) const
{
    for (const Point *other : box) {
        if (other == &point)
            continue;
        Vector along = point.position - other->position;
        const double distance = along.norm();
        if (distance >= 2 * scene.thickness || distance == 0)
            continue;
        along.normalize();
        sum += (2 * scene.thickness - distance) * along;
        count++;
    }
}

void cs184::collide_own(Point &point)
{
    Vector sum;
    int count = 0;
    add_corrections(point, *map[hash(point.position)], sum, count);
    if (count > 0 && !point.pinned)
        point.position += sum / count / scene.substeps;
}

/* A point that was pushed may be in a box that is not in the map. */
void cs184::collide_all(Point &point)
{
    const double size = 3 * scene.width / scene.side, reach = 2 * scene.thickness;
    const Vector &x = point.position;
    Vector sum;
    int count = 0;
    for (double i = std::floor((x.x - reach) / size); i <= std::floor((x.x + reach) / size); i++)
        for (double j = std::floor((x.y - reach) / size); j <= std::floor((x.y + reach) / size); j++)
            for (double k = std::floor((x.z - reach) / size); k <= std::floor((x.z + reach) / size); k++) {
                const auto box = map.find(key(i, j, k));
                if (box != map.end())
                    add_corrections(point, *box->second, sum, count);
            }
    if (count > 0 && !point.pinned)
        point.position += sum / count / scene.substeps;
}

/* ---- The limit ---- */

void cs184::limit_lengths()
{
    for (Spring &s : springs) {
        if (s.a->pinned && s.b->pinned)
            continue;
        Vector along = s.b->position - s.a->position;
        const double excess = along.norm() - 1.1 * s.rest;
        if (!(excess > 0))
            continue;
        along.normalize();
        if (s.b->pinned) {
            s.a->position += excess * along;
        } else if (s.a->pinned) {
            s.b->position -= excess * along;
        } else {
            s.a->position += 0.5 * excess * along;
            s.b->position -= 0.5 * excess * along;
        }
    }
}

void cs184::simulate()
{
    add_forces();
    integrate(1 / scene.frame_rate / scene.substeps);
    build_map();
    for (Point &p : points)
        scene.all_boxes ? collide_all(p) : collide_own(p);
    for (Point &p : points)
        for (Object *object : objects)
            object->collide(p);
    limit_lengths();
}

/* ---- For C ---- */

cs184 *cs184_open(const cs184_scene *scene, const double *start, const bool *pinned)
{
    auto *c = new cs184();
    c->scene = *scene;
    for (int i = 0; i < scene->side * scene->side; i++, start += 3) {
        const Vector x = {start[0], start[1], start[2]};
        c->points.push_back({pinned[i], x, x, x, {}, nullptr});
    }
    c->build();
    return c;
}

void cs184_frame(cs184 *c)
{
    for (int k = 0; k < c->scene.substeps; k++)
        c->simulate();
}

void cs184_position(const cs184 *c, int point, double x[3])
{
    const Vector &from = c->points[point].position;
    x[0] = from.x, x[1] = from.y, x[2] = from.z;
}

void cs184_close(cs184 *c)
{
    c->forget();
    delete c;
}
