/* Forces of haptic_link.h are passive, in a simulation of a hand, a device, a network and `ebpo
 * haptic`: with delays, lost packets, and a device that is unplugged in contact. Times are steps of
 * 1 ms. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/haptic.h>

#include "check_main.h"
#include "haptic_link.h"
#include "query_support.h"

/* DELAY_MAX: greatest delay of a packet, with jitter. PLUGGED_OUT to PLUGGED_IN: steps in which all
 * packets are lost, if the network `unplugs`. */
enum { STEPS = 3000, DELAY_MAX = 32, PLUGGED_OUT = 700, PLUGGED_IN = 1400 };

static const double stiffness = 400;

typedef struct network {
    int delay, jitter; /* steps, in each direction */
    int loss_percent;
    bool unplugs;
} network;

static const network networks[] = { { 0, 0, 0, false },   { 1, 0, 0, false },
                                    { 2, 0, 10, false },  { 5, 2, 10, false },
                                    { 10, 5, 10, false }, { 20, 10, 10, false },
                                    { 0, 0, 0, true },    { 20, 10, 10, true } };
enum { NETWORKS = sizeof networks / sizeof *networks };

typedef struct packet {
    uint64_t sequence; /* 0: no packet */
    double v[3];
} packet;

/* Packets in one direction, by the step in which they arrive. */
typedef struct wire {
    packet at[STEPS + DELAY_MAX];
} wire;

typedef struct simulation {
    query_model m;
    ebpo_haptic *haptic;
    const network *net;
    uint64_t state; /* random */
    wire up, down;
    packet pose; /* the last one that `ebpo haptic` has received */
    haptic_link link;
    bool controlled; /* false: the device applies the received forces directly */
    double hand[3], speed[3], force[3];
    /* energy: received by the hand since the last contact, plus what it received before in addition
     * to what it gave. longest: its longest motion in one step */
    double energy, longest;
    double force_max, unplugged_force_max;
} simulation;

static void begin(simulation *s, const network *net, bool controlled)
{
    static const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 }, above[3] = { 0.3, 0.4, 1.1 };
    ebpo_haptic_options options = EBPO_HAPTIC_OPTIONS_INIT;
    memset(s, 0, sizeof *s);
    query_model_make(&s->m, "box", ebpo_test_box(low, high, 4), &query_variants[0]);
    options.stiffness = stiffness;
    ASSERT_OK(ebpo_haptic_new(s->m.model, &options, above, &s->haptic, error));
    s->net = net;
    s->state = 7;
    s->controlled = controlled;
    s->link.stiffness = stiffness;
    s->link.force_max = INFINITY;
    memcpy(s->hand, above, sizeof above);
    memcpy(s->pose.v, above, sizeof above);
}

static void end(simulation *s)
{
    ebpo_haptic_free(s->haptic);
    query_model_free(&s->m);
}

/* Sends a packet, which may get lost or overtake others. */
static void send_packet(simulation *s, wire *w, int step, uint64_t sequence, const double v[3])
{
    const network *n = s->net;
    int arrival = step + n->delay + (w == &s->down); /* the hand has done its step before */
    if (n->jitter)
        arrival += (int)(ebpo_test_random(&s->state) % (uint64_t)(n->jitter + 1));
    bool lost = ebpo_test_random(&s->state) % 100 < (uint64_t)n->loss_percent;
    if (lost || (n->unplugs && step >= PLUGGED_OUT && step < PLUGGED_IN))
        return;
    packet *p = &w->at[arrival];
    if (sequence < p->sequence)
        return; /* of packets that arrive in one step, only the newest counts */
    p->sequence = sequence;
    memcpy(p->v, v, sizeof p->v);
}

/* Does a step of `ebpo haptic`. */
static void step_server(simulation *s, int step)
{
    ebpo_haptic_ball_result r;
    const packet *p = &s->up.at[step];
    if (p->sequence > s->pose.sequence)
        s->pose = *p;
    ebpo_haptic_step_ball(s->haptic, s->pose.v, &r);
    if (s->pose.sequence)
        send_packet(s, &s->down, step, s->pose.sequence, r.force);
}

/* Moves the hand: a given motion into the cube and out of it, which ends outside. Or a mass of 0.05
 * on a spring, pressed to the cube, which the applied force can shake. */
static void move_hand(simulation *s, int step, bool free)
{
    double t = step / 1000.0, press = sin(6 * t);
    const double goal[3] = { 0.3 + 0.03 * sin(3 * t), 0.4, 1.1 - 0.15 * press * press };
    for (int k = 0; k < 3; k++) {
        double acceleration = (60 * (goal[k] - s->hand[k]) + s->force[k]) / 0.05;
        s->speed[k] += 0.001 * acceleration;
        s->hand[k] = free ? s->hand[k] + 0.001 * s->speed[k] : goal[k];
    }
}

static double length_of(const double v[3]) { return hypot(hypot(v[0], v[1]), v[2]); }

static void step_hand(simulation *s, int step, bool free)
{
    double before[3] = { s->hand[0], s->hand[1], s->hand[2] }, moved[3];
    move_hand(s, step, free);
    for (int k = 0; k < 3; k++) {
        moved[k] = s->hand[k] - before[k];
        s->energy += s->force[k] * moved[k];
    }
    s->longest = fmax(s->longest, length_of(moved));
    send_packet(s, &s->up, step, (uint64_t)step + 1, s->hand);
    const packet *p = &s->down.at[step];
    if (p->sequence && s->controlled)
        haptic_link_receive(&s->link, p->sequence, p->v);
    else if (p->sequence)
        memcpy(s->force, p->v, sizeof p->v);
    if (s->controlled)
        haptic_link_step(&s->link, 0.001, s->hand, s->force);
    if (length_of(s->force) == 0)
        s->energy = fmax(s->energy, 0);
    s->force_max = fmax(s->force_max, length_of(s->force));
    if (s->net->unplugs && step >= PLUGGED_OUT + DELAY_MAX + 101 && step < PLUGGED_IN)
        s->unplugged_force_max = fmax(s->unplugged_force_max, length_of(s->force));
}

/* Returns the greatest energy that the hand has received, as a share of the tolerance. */
static double play(simulation *s, bool free)
{
    double most = -INFINITY;
    for (int step = 0; step < STEPS; step++) {
        step_hand(s, step, free);
        step_server(s, step);
        if (s->longest > 0)
            most = fmax(most, s->energy / (stiffness * s->longest * s->longest));
    }
    return most;
}

START_TEST(test_haptic_link_is_passive)
{
    static simulation s;
    for (int free = 0; free < 2; free++) {
        const network *n = &networks[_i];
        begin(&s, n, true);
        double most = play(&s, free);
        ck_assert_msg(most <= 1 + 1e-9, "delay %d, loss %d %%, %s: received %g of the tolerance",
                      n->delay, n->loss_percent, free ? "mass" : "motion", most);
        ck_assert_double_gt(s.force_max, free ? 1 : 8); /* the cube is felt */
        ck_assert_double_eq(s.unplugged_force_max, 0);
        end(&s);
    }
}
END_TEST

/* The received forces themselves are not passive with a delay, and remain while the device is
 * unplugged. So the test above can fail. */
START_TEST(test_haptic_link_is_needed)
{
    static simulation s;
    begin(&s, &networks[5], false);
    ck_assert_double_gt(play(&s, false), 10);
    end(&s);
    begin(&s, &networks[6], false);
    (void)play(&s, false);
    ck_assert_double_gt(s.unplugged_force_max, 1);
    end(&s);
}
END_TEST

/* Returns a link whose hand has given energy in 50 steps of 1 mm, against the force `push`. */
static haptic_link pressed_link(double hand[3], const double push[3])
{
    haptic_link link = { .stiffness = stiffness, .force_max = 4 };
    double force[3];
    for (int i = 0; i < 50; i++) {
        hand[2] -= 0.001;
        haptic_link_receive(&link, (uint64_t)i + 1, push);
        haptic_link_step(&link, 0.001, hand, force);
    }
    ck_assert_double_eq(force[2], 4);
    return link;
}

/* Without replies to new positions, the force is 0 after HAPTIC_LINK_ZERO, also if the replies to
 * an old position go on. Forces that are not finite change nothing. */
START_TEST(test_haptic_link_decays)
{
    const double push[3] = { 0, 0, 5 }, bad[3] = { 0, NAN, 0 };
    for (int repeats = 0; repeats < 2; repeats++) {
        double hand[3] = { 0 }, force[3], before = INFINITY;
        haptic_link link = pressed_link(hand, push);
        for (int i = 1; i <= 120; i++, before = force[2]) {
            if (repeats)
                haptic_link_receive(&link, 50, push);
            haptic_link_receive(&link, 51, bad);
            haptic_link_step(&link, 0.001, hand, force);
            ck_assert_double_le(force[2], before);
            ck_assert_msg(i > 48 ? i < 101 || force[2] == 0 : force[2] == 4, "%d: %g", i, force[2]);
        }
        ck_assert_double_eq(link.energy, 0); /* given energy is lost */
    }
}
END_TEST

/* At a position that is not finite, and at a motion longer than force_max / stiffness, the force is
 * 0 at once. The unknown motion changes neither the energy nor the longest motion. The first
 * position is the start. */
START_TEST(test_haptic_link_unknown_motions)
{
    const double push[3] = { 0, 0, 5 }, bad[3] = { 0, NAN, 0 }, far[3] = { 0, 0, -9 };
    const double *first[3] = { bad, far, NULL };
    for (int i = 0; i < 3; i++) {
        double hand[3] = { 3, -2, 7 }, force[3], after[3];
        haptic_link link = { .stiffness = stiffness, .force_max = 4 };
        if (first[i]) {
            link = pressed_link(hand, push);
            haptic_link_receive(&link, 51, push);
            haptic_link_step(&link, 0.001, first[i], force);
            ck_assert_double_eq(force[2], 0);
        }
        double longest = link.longest;
        ck_assert_double_le(longest, 0.0011);
        haptic_link_receive(&link, 52, push);
        haptic_link_step(&link, 0.001, hand, force);
        ck_assert_double_eq(force[2], 0);
        ck_assert_double_eq(link.energy, 0);
        ck_assert_double_eq(link.longest, longest);
        memcpy(after, hand, sizeof after);
        after[2] -= 0.0005; /* the next motion is known */
        haptic_link_step(&link, 0.001, after, force);
        ck_assert_double_gt(force[2], 0);
        ck_assert_double_le(force[2], stiffness * fmax(longest, 0.00051));
    }
}
END_TEST

/* After a time that is negative or not a number, the force is 0 until the next reply. */
START_TEST(test_haptic_link_bad_times)
{
    const double push[3] = { 0, 0, 5 }, times[3] = { -0.001, NAN, INFINITY };
    for (int i = 0; i < 3; i++) {
        double hand[3] = { 0 }, force[3];
        haptic_link link = pressed_link(hand, push);
        haptic_link_step(&link, times[i], hand, force);
        ck_assert_double_eq(force[2], 0);
        haptic_link_step(&link, 0.001, hand, force);
        ck_assert_double_eq(force[2], 0);
        haptic_link_receive(&link, 51, push);
        hand[2] -= 0.001;
        haptic_link_step(&link, 0.001, hand, force);
        ck_assert_double_gt(force[2], 0);
    }
}
END_TEST

/* A long motion outside of contacts does not allow a greater force in the next contact. */
START_TEST(test_haptic_link_forgets_motions)
{
    const double push[3] = { 0, 0, 5 };
    double hand[3] = { 0 }, force[3];
    haptic_link link = { .stiffness = stiffness, .force_max = 4 };
    for (int i = 0; i < 10; i++) {
        hand[0] += i < 5 ? 0.009 : 1e-4;
        haptic_link_step(&link, 0.001, hand, force);
    }
    haptic_link_receive(&link, 1, push);
    hand[0] += 1e-4;
    haptic_link_step(&link, 0.001, hand, force);
    ck_assert_double_gt(force[2], 0);
    ck_assert_double_le(force[2], stiffness * 1.001e-4);
}
END_TEST

/* Packets that are not replies to sent positions are ignored. The flag of a stopped haptic object,
 * and SIGINT, end the device with force 0. */
START_TEST(test_haptic_link_checks_replies)
{
    const double hand[3] = { 0 }, unit[4] = { 0, 0, 0, 1 };
    struct sockaddr_in at = { .sin_family = AF_INET };
    socklen_t length = sizeof at;
    haptic_link link;
    double force[3];
    struct {
        haptic_reply_packet reply;
        char more[9];
    } bad[8] = { 0 };
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    int server = socket(AF_INET, SOCK_DGRAM, 0);
    ck_assert_int_eq(bind(server, (const struct sockaddr *)&at, sizeof at), 0);
    ck_assert_int_eq(getsockname(server, (struct sockaddr *)&at, &length), 0);
    ck_assert(!haptic_link_open(&link, ntohs(at.sin_port), 0, 4));
    close(link.socket);
    ck_assert(haptic_link_open(&link, ntohs(at.sin_port), stiffness, 4));
    ck_assert(haptic_link_exchange(&link, hand, unit, false, force));
    length = sizeof at;
    ck_assert_int_eq(recvfrom(server, &bad[0], sizeof bad[0], 0, (struct sockaddr *)&at, &length),
                     80);
    for (int i = 0; i < 8; i++)
        bad[i].reply = (haptic_reply_packet){
            .magic = "EBPT", .version = 1, .kind = 2, .sequence = 1, .force = { 0, 0, 5 }
        };
    bad[0].reply.magic[0] = 'e';
    bad[1].reply.version = 2;
    bad[2].reply.kind = 1;
    bad[3].reply.sequence = 3; /* two positions are sent */
    bad[4].reply.force[1] = NAN;
    for (int i = 0; i < 8; i++) /* 5: too short; 6: too long; 7: valid */
        sendto(server, &bad[i],
               i == 5   ? 191
               : i == 6 ? 193
                        : 192,
               0, (const struct sockaddr *)&at, length);
    ck_assert(haptic_link_exchange(&link, hand, unit, false, force));
    ck_assert_uint_eq(link.sequence, 1);
    ck_assert_double_eq(link.received[2], 5);
    link.sequence = 0;
    for (int i = 0; i < 7; i++)
        sendto(server, &bad[i],
               i == 5   ? 191
               : i == 6 ? 193
                        : 192,
               0, (const struct sockaddr *)&at, length);
    link.sent = 1; /* the next position has number 2 */
    ck_assert(haptic_link_exchange(&link, hand, unit, false, force));
    ck_assert_uint_eq(link.sequence, 0);
    bad[7].reply.sequence = 2;
    for (int i = 0; i < 2; i++) { /* SIGINT at a force that is not 0 */
        const double up[3] = { 0, 0, -1e-3 * (i + 1) };
        sendto(server, &bad[7], 192, 0, (const struct sockaddr *)&at, length);
        if (i == 1)
            raise(SIGINT);
        ck_assert_int_eq(haptic_link_exchange(&link, up, unit, false, force), i == 0);
        ck_assert_int_eq(force[2] > 0, i == 0);
    }
    haptic_link_interrupted = 0;
    bad[7].reply.sequence = 3;
    bad[7].reply.flags = EBPO_HAPTIC_STOPPED;
    sendto(server, &bad[7], 192, 0, (const struct sockaddr *)&at, length);
    ck_assert(!haptic_link_exchange(&link, hand, unit, false, force));
    ck_assert_double_eq(force[2], 0);
    haptic_link_close(&link);
    close(server);
}
END_TEST

TEST_SUITE(haptic_link)
{
    Suite *suite = suite_create("haptic_link");
    TCase *tc = tcase_create("haptic_link");
    tcase_set_timeout(tc, 600);
    tcase_add_loop_test(tc, test_haptic_link_is_passive, 0, NETWORKS);
    tcase_add_test(tc, test_haptic_link_is_needed);
    tcase_add_test(tc, test_haptic_link_decays);
    tcase_add_test(tc, test_haptic_link_unknown_motions);
    tcase_add_test(tc, test_haptic_link_bad_times);
    tcase_add_test(tc, test_haptic_link_forgets_motions);
    tcase_add_test(tc, test_haptic_link_checks_replies);
    suite_add_tcase(suite, tc);
    return suite;
}
