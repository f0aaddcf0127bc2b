/*
 * fabrics_table.h: the entries of drape_fabrics and their number. fabrics.c explains sources and units.
 * ENTRY(name, what it is, source, areal density, C11, C22, C12, C66 of tension, C11 and C22 at a strain of
 * 1/6, rigidities along warp, weft and the diagonal, HB of bending, drape coefficient), in SI units; NAN: not
 * published.
 */
#ifndef DRAPE_COMPILE_FABRICS_TABLE_H
#define DRAPE_COMPILE_FABRICS_TABLE_H

#define GF_CM 9.80665e-5 /* gf cm2/cm [N m] */
#define GF    9.80665e-3 /* gf cm/cm [N m/m] */

#define WANG       "Wang, O'Brien & Ramamoorthi 2011"
#define FENG       "Feng, Huang, Xu & Wang 2022"
#define MATSUDAIRA "Matsudaira, Masuda, Wada & Yokura 2015"

/* clang-format off */

#define OF_WANG(ENTRY, name, what, density, c11, c12, c22, c33, far_c11, far_c22, along_v, diagonal,         \
                along_u)                                                                                     \
    ENTRY(name, what, WANG, density,                                                                         \
        2 * (c22), 2 * (c11), 2 * (c12), c33, 2 * (far_c22), 2 * (far_c11),                                  \
        2.5e-7 * (along_v), 2.5e-7 * (along_u), 2.5e-7 * (diagonal), NAN, NAN)
#define OF_FENG(ENTRY, number, density, warp, weft, diagonal)                                                \
    ENTRY("feng2022_" #number, "number " #number " of 618", FENG, density,                                   \
        NAN, NAN, NAN, NAN, NAN, NAN, 1e-9 * (warp), 1e-9 * (weft), 1e-9 * (diagonal), NAN, NAN)
#define OF_MATSUDAIRA(ENTRY, name, what, density, bending, loop, drape)                                      \
    ENTRY(name, what, MATSUDAIRA, density,                                                                   \
        NAN, NAN, NAN, NAN, NAN, NAN, GF_CM * (bending), GF_CM * (bending), NAN, GF / 2 * (loop), drape)

#define DRAPE_FABRICS(ENTRY)                                                                                 \
    ENTRY("none", "no measured fabric", "", 0, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN)        \
    OF_FENG(ENTRY, 1, 0.0673, 1779.9, 3076.2, 2244.1)                                                        \
    OF_FENG(ENTRY, 3, 0.1834, 61211.1, 24116.1, 23803.5)                                                     \
    OF_FENG(ENTRY, 6, 0.1972, 9183.1, 7598.0, 3752.0)                                                        \
    OF_FENG(ENTRY, 9, 0.0224, 866.3, 1141.2, 1529.6)                                                         \
    OF_FENG(ENTRY, 18, 0.4773, 32775.9, 22098.3, 15268.1)                                                    \
    OF_FENG(ENTRY, 23, 0.4871, 115747.3, 49453.8, 83508.1)                                                   \
    OF_WANG(ENTRY, "wang2011_denim", "jeans, 99 % cotton 1 % spandex, 11 oz", 0.324,                         \
        205.352005, 10.234077, 1013.88629, 53.387184, 232.027634, 1051.55712,                                \
        64.196457, 73.384567, 96.951576)                                                                     \
    OF_WANG(ENTRY, "wang2011_pants", "pants, 65 % cotton 35 % polyester", 0.220,                             \
        2016.55456, 9.170511, 2034.97644, 104.759674, 2109.51684, 2152.73852,                                \
        125.409805, 107.997696, 125.409805)                                                                  \
    OF_WANG(ENTRY, "wang2011_tablecloth", "tablecloth, polyester", 0.128,                                    \
        2002.08618, 0.345588, 2027.48559, 19.189022, 2107.22753, 2150.4768,                                  \
        51.713814, 40.659470, 31.282822)                                                                     \
    OF_WANG(ENTRY, "wang2011_blanket", "blanket, polyester", 0.228,                                          \
        151.503906, 106.028160, 244.830673, 30.250183, 164.124344, 359.792633,                               \
        117.070122, 87.509773, 59.774277)                                                                    \
    OF_WANG(ENTRY, "wang2011_jacket", "jacket, polyester", 0.113,                                            \
        43.067627, 54.373299, 171.424835, 14.314700, 75.151695, 404.867188,                                  \
        14.293814, 21.951700, 20.345654)                                                                     \
    OF_WANG(ENTRY, "wang2011_swimsuit", "swimsuit, 87 % nylon 13 % spandex", 0.204,                          \
        47.971176, 6.834521, 104.615456, 60.773663, 40.369045, 124.468513,                                   \
        60.237942, 58.803211, 51.018833)                                                                     \
    OF_WANG(ENTRY, "wang2011_tshirt", "T-shirt, 60 % cotton 40 % polyester", 0.187,                          \
        16.593832, 0, 34.477123, 36.860302, 46.364765, 405.872833,                                           \
        23.191698, 24.749964, 14.267624)                                                                     \
    OF_MATSUDAIRA(ENTRY, "matsudaira2015_broad", "cotton broadcloth", 0.1238, 0.118, 0.124, 0.829)           \
    OF_MATSUDAIRA(ENTRY, "matsudaira2015_wool", "wool tropical", 0.1629, 0.067, 0.033, 0.498)                \
    OF_MATSUDAIRA(ENTRY, "matsudaira2015_tropical", "polyester tropical", 0.1165, 0.077, 0.029, 0.507)       \
    OF_MATSUDAIRA(ENTRY, "matsudaira2015_faille", "polyester faille", 0.1043, 0.019, 0.007, 0.283)

/* clang-format on */

#define DRAPE_FABRIC_ONE(...) +1
enum { DRAPE_FABRIC_COUNT = DRAPE_FABRICS(DRAPE_FABRIC_ONE) - 1 }; /* without "none" */

#endif
