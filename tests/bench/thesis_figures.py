"""Values of the two theses that theses.py compares with, with the tables that they are from.

BP: Melero 2008. EBP: Aguilera 2017. Levels: BP counts from 0, EBP from 1 (its level 1 is the root);
lists here begin with the root."""

MACHINES = ("BP: AMD, 64 bits, 2 GB of memory, gcc -O3 (section 3.5)",
            "EBP: a home computer that the text does not describe")

# BP tables 3.3 (s), 3.9 (KB of .bpn, .bpl, .ply) and 5.1 (tests/s with envelopes), K = 1 %, N = 50.
BP_MODELS = {"bunny": {"faces": 71_040, "build": 43.72, "kb": (2038.5, 908.6, 1331.4), "tests": 2_840_909},
             "dragon": {"faces": 871_414, "build": 963.77, "kb": (25126.4, 10562.8, 16191.5),
                        "tests": 2_941_176}}
# BP tables 4.3 (percent of the solid's volume) and 4.1 (planes).
BP_VOLUME = {"bunny": (171.41, 144.71, 119.92, 107.33, 103.11, 101.14, 100.55, 100.55),
             "dragon": (277.82, 199.08, 165.60, 135.50, 111.44, 103.68, 101.30, 100.50, 100.32)}
BP_PLANES = {"bunny": (656, 2004, 4976, 11716, 25093, 53180, 86010, 50),
             "dragon": (2955, 7287, 18373, 43876, 99023, 203160, 408036, 754485, 672812, 26074)}
# BP table 3.1: leaves of the bunny by level, criteria 1 (N = 50) and 2 (AV = 20).
BP_LEAVES = {"sum": (0, 0, 1, 17, 189, 1706, 11694, 13), "mean": (0, 0, 0, 1, 10, 177, 3779, 12)}
# BP tables 3.5 (planes of the root) and 3.6 (percent of volume) of the dragon by K in percent.
BP_ROOT = {"1": 2955, "0.5": 2880, "0.1": 746, "0.05": 394, "0.01": 81}
BP_K_VOLUME = {"0.1": (374.83, 248.80, 198.60, 154.78, 121.45, 108.49, 102.55, 100.49, 100.36),
               "0.5": (293.14, 204.83, 169.79, 138.12, 112.97, 104.53, 101.74, 100.70, 100.41),
               "1": (277.82, 199.08, 165.60, 135.50, 111.44, 103.68, 101.30, 100.50, 100.32),
               "5": (263.65, 192.56, 162.63, 133.70, 110.62, 103.27, 101.11, 100.41, 100.27)}
# BP tables 4.4 and 4.11, by level: planes (all, sent before, displaced), polygons and vertices of leaves
# (all, sent before), leaves; and the reported bytes.
BP_SENT = {"bunny": ((656, 0, 634, 0, 0, 0, 0, 0, 13_035),
                     (2004, 697, 1888, 0, 0, 0, 0, 0, 31_384),
                     (4976, 2243, 4597, 9, 9, 27, 27, 1, 73_558),
                     (11716, 6012, 10480, 330, 194, 990, 904, 17, 232_372),
                     (25093, 15071, 21542, 3624, 2073, 10872, 9906, 189, 1_006_872),
                     (53180, 34868, 43155, 30912, 16391, 92736, 84530, 1706, 3_248_614),
                     (86010, 66600, 63448, 141442, 86641, 424326, 398076, 11694, 879_022),
                     (50, 41, 39, 102, 71, 306, 292, 13, 516)),
           "dragon": ((2955, 0, 2689, 0, 0, 0, 0, 0, 58_039),
                      (7287, 3023, 6510, 0, 0, 0, 0, 0, 106_380),
                      (18373, 7694, 16187, 0, 0, 0, 0, 0, 266_547),
                      (43876, 20090, 38487, 129, 19, 387, 307, 4, 621_285),
                      (99023, 49949, 85445, 1038, 630, 3114, 2870, 62, 1_350_210),
                      (203160, 118868, 170583, 11086, 6178, 33258, 30132, 639, 2_758_797),
                      (408036, 266429, 328052, 124837, 67019, 374511, 340361, 6933, 7_491_425),
                      (754485, 545746, 576341, 900007, 506341, 2700021, 2493912, 57878, 27_010_879),
                      (672812, 528315, 494001, 1155304, 757590, 3465912, 3280744, 111654, 25_940_696),
                      (26074, 19949, 19855, 52722, 35932, 158166, 149398, 5486, 710_344))}

# BP tables 3.4 (s for K = 1 and 0.05 %) and 3.7, 3.8 (percent of volume at L0 for K = 1 and 0.1 %).
BP_K_SECONDS = {"Happy Buddha": (1573.40, 160.82), "Blade": (1565.60, 315.91), "Asian Dragon": (8614.58, 1599.98)}
BP_K_ROOT_VOLUME = {"Happy Buddha": (196.91, 249.85), "Blade": (373.79, 458.38)}

EBP_FACES = {"Amazona": 28_099_530, "Lucy": 28_055_742}
EBP_LEVEL_COUNT = 11
# EBP tables 2 to 4: bytes of .bpl and .bvp of Amazona, 10 to 50 %; the other files do not change.
EBP_OTHER_BYTES = 4_050_960_974
EBP_BPL = {"offset": (267016464, 362579872, 531866432, 742609168, 1090792544),
           "random": (267012288, 363468864, 534347872, 746242688, 1093709488),
           "kmedoids": (316152624, 405736000, 572177440, 783562656, 1121494016)}
EBP_BVP = {"offset": (5227077348, 6064463328, 7471158780, 9056868396, 11414966868),
           "random": (5225244600, 6047933472, 7449141384, 9045937404, 11425989480),
           "kmedoids": (5635242936, 6425022468, 7831076292, 9475811652, 11862296592)}
# EBP tables 8 to 10, seconds, and 11, seconds of loading; 10 to 50 %.
EBP_BUILD = {"offset": (2883.53, 2997.60, 3047.13, 3177.39, 3800.73),
             "random": (2786.74, 2825.25, 2886.86, 2996.15, 3636.72),
             "kmedoids": (3194.35, 3467.90, 3799.08, 4360.89, 8932.20)}
EBP_LOAD = {"offset": (3.22233, 3.33180, 3.53939, 3.71713, 3.80228),
            "random": (3.31208, 3.45966, 3.54790, 3.63529, 3.75913),
            "kmedoids": (3.38389, 3.40522, 3.66873, 3.66060, 4.12781)}
# EBP tables 12 to 14: percent of the volume of Amazona, by level, 10 to 50 %.
EBP_VOLUME = {
    "offset": ((659.137, 607.017, 623.215, 422.045, 323.866), (648.229, 612.117, 542.991, 337.943, 261.385),
               (374.227, 375.700, 323.506, 228.542, 173.958), (223.876, 225.309, 198.493, 154.962, 129.777),
               (150.981, 151.582, 137.099, 119.474, 111.360), (119.096, 118.908, 112.874, 107.397, 104.611),
               (106.678, 106.544, 104.155, 102.520, 101.698)),
    "random": ((659.890, 653.335, 383.790, 321.109, 306.970), (615.540, 588.945, 424.922, 278.184, 234.506),
               (385.375, 377.095, 266.533, 174.758, 138.257), (223.816, 224.605, 165.712, 128.606, 117.620),
               (149.560, 148.442, 125.544, 111.529, 107.373), (118.511, 118.305, 109.138, 105.236, 103.678),
               (106.780, 106.577, 103.178, 101.996, 101.460)),
    "kmedoids": ((617.006, 656.256, 517.152, 316.623, 291.294), (550.897, 576.428, 375.257, 256.464, 237.828),
                 (337.620, 332.450, 221.586, 167.970, 134.476), (201.537, 194.528, 143.174, 123.991, 116.783),
                 (137.076, 135.024, 116.283, 109.782, 107.299), (113.740, 112.803, 106.387, 104.376, 103.514),
                 (105.055, 104.456, 102.309, 101.683, 101.359))}
# Lucy, k-medoids, 40 %: EBP tables 15 (bytes), 16 (MB by level), 18 to 20.
EBP_LUCY = {"ply": 533_061_632, "collisions": 4_701_104_870, "rendering": 13_319_862_602,
            "build": 3524.47, "load": 3.36974, "root_mb": 11.52648,
            "mb": (0.1233, 0.3749, 0.9540, 2.6511, 7.1530, 20.7789, 127.1625, 391.9255, 1215.5654,
                   3877.1204, 11955.4609),
            "volume": (466.70, 231.79, 169.64, 127.32, 115.50, 107.67, 102.69, 100.84, 100.28, 100.10,
                       100.04)}
# Lucy, k-medoids, 30 and 40 %: seconds, and excess volume of the fifth level.
EBP_LUCY_TIMES = [(3050.69, 24.67), (3524.47, 15.50)]
# EBP tables 21 and 22, Lucy: us for a test of a random point, and of a point of a path.
EBP_MODES = {"cache": (1986.73, 290.82), "nodes": (1291.53, 436.85), "subtree": (1355.21, 373.84),
             "cache-plain": (2396.08, 320.14), "nodes-plain": (1791.04, 364.22),
             "subtree-plain": (2332.67, 321.40)}
# EBP tables 23 and 24, Lucy, with cache, us by level.
EBP_INSIDE_LEVELS = ((3.85, 1.70), (4.47, 2.26), (4.85, 2.59), (5.03, 2.73), (5.19, 2.80),
                     (2565.26, 182.56), (2584.33, 199.13), (2580.50, 199.24), (2577.60, 199.12),
                     (2576.87, 199.06), (3001.68, 199.17))
# EBP table 27, Lucy, us: "recursivo" and, by level, the envelope. Level 3 of random points is printed
# as 0, and is left out.
EBP_RECURSIVE = (878.116, 14.691)
EBP_DISTANCE_LEVELS = ((77.537, 62.787), (27.440, 20.440), (None, 12.549), (14.312, 5.373),
                       (13.030, 3.517), (12.699, 4.406), (6441.030, 82.120), (5725.785, 80.736),
                       (5638.451, 81.751), (5627.434, 82.357), (5406.070, 84.955))
# EBP tables 30 and 31: models, pairs of faces a step, us a pair, optimised; and our scenario beside it.
EBP_PAIRS = (("Lucy 28 M, itself", 38264.048, 0.090, 0.009, "lucy_lucy"),
             ("Amazona 28 M, itself", 15790.694, 0.146, 0.016, None),
             ("Amazona 28 M, armadillo 150 K", 971.052, 4.271, 0.434, "lucy_armadillo"),
             ("Moldura 26 M, armadillo 150 K", 2766.153, 0.984, 0.104, None))
# EBP tables 32 and 33: models, us of a first contact (EBP, optimised, PQP, SWIFT++, gProximity), our scenario.
EBP_FIRST = (("Amazona 2.5 M, itself", (1627.546, 29.237, 26430600, None, 158.289), "lucy16_lucy16"),
             ("armadillo 350 K, itself", (615.104, 35.750, 6206, 18000, 22.534), "armadillo_armadillo"),
             ("armadillo 350 K, Amazona 2.5 M", (72.392, 20.697, 1530, None, 30.559), "lucy16_armadillo"))


def sent_by_model(model, geometry):
    """Cumulative bytes of BP's cost model from the counts of table 4.4."""
    out, total = [], 0
    for planes, planes_before, moved, faces, faces_before, vertices, vertices_before, leaves, _ in BP_SENT[model]:
        total += 16 * (planes - planes_before) + 4 * planes_before + 4 * moved
        if geometry:
            total += (leaves + 12 * (faces - faces_before) + 4 * faces_before
                      + 12 * (vertices - vertices_before) + 4 * vertices_before)
        out.append(total)
    return out
