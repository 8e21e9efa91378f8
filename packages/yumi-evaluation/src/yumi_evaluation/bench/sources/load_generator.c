/* The robot's end of EGM for the reply benchmark: sends EgmRobot datagrams and measures how long each reply takes.
 *
 * What it sends is what an IRC5 with RobotWare 6.09 sends for one arm of a YuMi: header, feedBack and planned (6 joints,
 * pose with quaternion and Euler angles, axis 7 as external joint, time), motors on, MCI running, RAPID running, empty
 * test signals; joint values rounded to single precision. No protobuf library: about 390 bytes, written by hand.
 *
 * Latency of a cycle = kernel receive time stamp of its reply - clock just before its datagram was handed to the kernel.
 * Both are CLOCK_REALTIME. The generator's own wake-up is not in it.
 *
 * Every server under test obeys reply = measured + gain * (goal - measured) on all seven axes (gain 0: an echo). Axis 1
 * moves by a ten-thousandth of a degree per cycle and never comes back, so a reply's axis 1 shows which cycle it
 * answers; the other axes swing smoothly by 10 degrees. All seven values of every reply are checked. A robot that got
 * no answer is not where its server expects it, and a server with a limiter catches up in safe steps: for a
 * while after an unanswered cycle a reply with other values counts as "recovering", and as the answer to the newest cycle.
 *
 *   lead-in   the robot stands until 25 replies in a row were right
 *   warm-up   cycles that are sent but not counted; "begin" is printed before
 *   counted   --cycles cycles; "end" is printed after, then one line of JSON
 *
 * Exit codes: 0 done, 1 the server did not answer as it should or stopped answering, 2 wrong option.
 */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "egm_wire.h"

enum { AXES = 7, ROBAX = 6, MAX_ARMS = 2, LEAD_IN_RIGHT = 25, LOST_IN_A_ROW = 500 };

static const double CODE_DEG = 1e-4;      /* axis 1 per cycle: a limiter that bounds speed, acceleration and jerk passes it */
static const double OFFSET_DEG = 0.005;   /* goal - start: the reply that moves an arm differs from that of a held one */
static const double SWING_DEG = 10.0;
static const double SWING_CYCLES = 1000.0;
static const double TOLERANCE_DEG = 1e-6;
static const long RECOVERY = 50;          /* cycles after an unanswered one in which a limiter may still catch up */
static const int64_t SECOND = 1000000000;
static const int64_t ANSWER_TIMEOUT = 100000000;  /* ping-pong: after this the reply counts as missed [ns] */
static const int64_t STRAGGLERS = 50000000;       /* how long replies are still read after the last cycle [ns] */

/* ---- options ---- */

static struct {
    int ports[MAX_ARMS], arms, is_ping_pong, cpu, priority;
    long cycles, warm_up;
    int64_t period, lead_in;
    double gain, goal[AXES];
    const char *output;
} set = {.cpu = -1, .cycles = 1000, .warm_up = 250, .period = 4000000, .lead_in = 20 * (int64_t)1000000000};

/* ---- clocks ---- */

static int64_t clock_ns(clockid_t id)
{
    struct timespec t;
    clock_gettime(id, &t);
    return t.tv_sec * SECOND + t.tv_nsec;
}

static struct timespec timespec_of(int64_t ns) { return (struct timespec){ns / SECOND, ns % SECOND}; }

static void sleep_until(int64_t due)
{
    struct timespec t = timespec_of(due);
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR) continue;
}

/* ---- the datagram ---- */

static void put_motion(Message *m, unsigned field, const double *axes, int64_t time)
{
    Message motion = {.size = 0}, pose = {.size = 0}, orient = {.size = 0}, clock = {.size = 0};
    put_triple(&pose, 1, 400.25f, -50.5f, 300.125f);
    put_double(&orient, 1, 0.70710677f), put_double(&orient, 2, 0), put_double(&orient, 3, 0.70710677f), put_double(&orient, 4, 0);
    put_message(&pose, 2, &orient);
    put_triple(&pose, 3, 0, 90, 0);
    put_number(&clock, 1, (uint64_t)(time / SECOND)), put_number(&clock, 2, (uint64_t)(time % SECOND / 1000));
    put_doubles(&motion, 1, axes, ROBAX);
    put_message(&motion, 2, &pose);
    put_doubles(&motion, 3, axes + ROBAX, 1);
    put_message(&motion, 4, &clock);
    put_message(m, field, &motion);
}

static void write_robot(Message *m, uint32_t seqno, const double *axes)
{
    int64_t robot_time = 1000 * SECOND + seqno * set.period; /* the robot's own clock: also in ping-pong one period a cycle */
    Message header = {.size = 0}, nothing = {.size = 0};
    m->size = 0;
    put_number(&header, 1, seqno), put_number(&header, 2, (uint64_t)(robot_time / 1000000)), put_number(&header, 3, 2);
    put_message(m, 1, &header);
    put_motion(m, 2, axes, robot_time);
    put_motion(m, 3, axes, robot_time);
    put_state(m, 4, 1); /* motors on */
    put_state(m, 5, 3); /* MCI running */
    put_number(m, 6, 0);
    put_message(m, 7, &nothing);
    put_state(m, 8, 2); /* RAPID running */
}

/* ---- the reply: an EgmSensor, or an EgmRobot that came back; what is read has the same numbers in both ---- */

static int read_reply(const uint8_t *bytes, size_t size, double *axes)
{
    Reader planned, joints, external;
    return find_message((Reader){bytes, bytes + size}, 2, &planned) && find_message(planned, 1, &joints) &&
           find_message(planned, 3, &external) && take_doubles(joints, axes, ROBAX) == ROBAX &&
           take_doubles(external, axes + ROBAX, 1) == 1;
}

/* ---- the robot's motion ---- */

static void measured_at(long code, double *axes)
{
    double swing = code > 0 ? SWING_DEG * (1 - cos(2 * M_PI * (double)code / SWING_CYCLES)) / 2 : 0;
    for (int i = 0; i < AXES; ++i) axes[i] = (float)(set.goal[i] - OFFSET_DEG + (i ? swing : (double)code * CODE_DEG));
}

static int is_right(const double *axes, long code)
{
    double measured[AXES];
    measured_at(code, measured);
    for (int i = 0; i < AXES; ++i)
        if (!(fabs(axes[i] - (measured[i] + set.gain * (set.goal[i] - measured[i]))) <= TOLERANCE_DEG)) return 0;
    return 1;
}

static long code_of(const double *axes)
{
    double measured = (axes[0] - set.gain * set.goal[0]) / (1 - set.gain);
    double code = (measured - (set.goal[0] - OFFSET_DEG)) / CODE_DEG;
    return fabs(code) < 1e9 ? lround(code) : -1;
}

/* ---- the arms ---- */

typedef struct {
    int socket;
    int64_t *sent, *latency; /* per moving cycle, warm-up included; latency 0: no right reply */
    uint8_t *wrong; /* per moving cycle: whether a bad reply came */
    long stale, bad, recovering, unparsed, duplicates, right_in_a_row;
    long gap; /* the unanswered cycle sent last */
} Arm;

static Arm arms[MAX_ARMS];
static struct pollfd readable[MAX_ARMS];

/* Take one reply; returns the moving cycle that it answers, right or wrong, -1 for none, -2 when nothing waits. */
static long take_reply(Arm *arm, long cycle)
{
    uint8_t bytes[2048];
    char control[256];
    struct iovec part = {bytes, sizeof bytes};
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
    ssize_t size = recvmsg(arm->socket, &message, MSG_DONTWAIT);
    if (size < 0) return errno == ECONNREFUSED ? -1 : -2;
    int64_t arrived = clock_ns(CLOCK_REALTIME);
    for (struct cmsghdr *c = CMSG_FIRSTHDR(&message); c; c = CMSG_NXTHDR(&message, c))
        if (c->cmsg_level == SOL_SOCKET && c->cmsg_type == SCM_TIMESTAMPNS) {
            struct timespec stamp;
            memcpy(&stamp, CMSG_DATA(c), sizeof stamp);
            arrived = stamp.tv_sec * SECOND + stamp.tv_nsec;
        }
    double axes[AXES];
    if (!read_reply(bytes, (size_t)size, axes)) { arm->unparsed++; return -1; }
    if (cycle < 0) { arm->right_in_a_row = is_right(axes, 0) ? arm->right_in_a_row + 1 : 0; return -1; }
    long code = code_of(axes);
    if (code == 0) return -1; /* a late answer to the lead-in */
    int is_wrong = code < 0 || code > cycle + 1 || !is_right(axes, code);
    if (is_wrong && cycle - arm->gap > RECOVERY) { arm->bad++; return arm->wrong[cycle]++ ? -1 : cycle; }
    if (is_wrong) arm->recovering++;
    long answered = is_wrong ? cycle : code - 1; /* code 0 is the lead-in */
    if (arm->latency[answered]) { arm->duplicates++; return -1; }
    arm->latency[answered] = arrived > arm->sent[answered] ? arrived - arm->sent[answered] : 1;
    if (answered != cycle) arm->stale++;
    return answered;
}

static void drain(long cycle)
{
    for (int i = 0; i < set.arms; ++i) while (take_reply(&arms[i], cycle) != -2) continue;
}

static void send_all(uint32_t seqno, long cycle)
{
    Message message;
    double axes[AXES];
    measured_at(cycle + 1, axes);
    write_robot(&message, seqno, axes);
    for (int i = 0; i < set.arms; ++i) {
        if (cycle > 0 && !arms[i].latency[cycle - 1]) arms[i].gap = cycle - 1;
        if (cycle >= 0) arms[i].sent[cycle] = clock_ns(CLOCK_REALTIME);
        if (send(arms[i].socket, message.bytes, message.size, 0) < 0) continue; /* no listener: the cycle is missed */
    }
}

/* Ping-pong: read replies until all arms have answered `cycle` or the deadline. */
static void wait_for_replies(long cycle, int64_t deadline)
{
    int missing = set.arms;
    int64_t left;
    while (missing && (left = deadline - clock_ns(CLOCK_MONOTONIC)) > 0) {
        struct timespec timeout = timespec_of(left);
        if (ppoll(readable, (nfds_t)set.arms, &timeout, NULL) <= 0) continue;
        for (int i = 0; i < set.arms; ++i)
            for (long answered = 0; readable[i].revents && answered != -2;)
                if ((answered = take_reply(&arms[i], cycle)) == cycle && cycle >= 0) missing--;
    }
}

static int is_unanswered(long cycle)
{
    for (int i = 0; i < set.arms; ++i) if (!arms[i].latency[cycle]) return 1;
    return 0;
}

/* ---- the three phases ---- */

static uint32_t seqno;
static int64_t due, latest, counted_since;
static volatile sig_atomic_t is_over;

static void end(int number) { (void)number; is_over = 1; }

static void next_tick(void)
{
    due += set.period;
    int64_t late = clock_ns(CLOCK_MONOTONIC) - due;
    if (late > set.period) due += late; /* this machine stood still: go on from here instead of sending a burst */
    sleep_until(due);
    late = clock_ns(CLOCK_MONOTONIC) - due + (late > set.period ? late : 0);
    if (late > latest) latest = late;
}

/* Paced: the kernel notes when each reply came, no process has to be awake for it. A robot shares no processor with its driver;
 * a generator that read the first arm's reply at once would take time from the second arm, on the same processor. */
static void sleep_and_read(long cycle)
{
    sleep_until(due + set.period / 2);
    drain(cycle);
}

static int lead_in(void)
{
    int64_t end_at = clock_ns(CLOCK_MONOTONIC) + set.lead_in;
    due = clock_ns(CLOCK_MONOTONIC);
    while (!is_over && clock_ns(CLOCK_MONOTONIC) < end_at) {
        int ready = 1;
        for (int i = 0; i < set.arms; ++i) ready &= arms[i].right_in_a_row >= LEAD_IN_RIGHT;
        if (ready) return 1;
        next_tick();
        send_all(seqno++, -1);
        sleep_and_read(-1);
    }
    return 0;
}

static void begin_counting(void) /* what was wrong stays counted: it is wrong at any time */
{
    counted_since = clock_ns(CLOCK_MONOTONIC), latest = 0;
    for (int i = 0; i < set.arms; ++i) arms[i].stale = arms[i].duplicates = 0;
}

static long run_cycles(long cycles)
{
    long cycle = 0;
    for (int lost = 0; cycle < cycles && !is_over && lost < LOST_IN_A_ROW; ++cycle) {
        int is_paced = !set.is_ping_pong;
        if (cycle == set.warm_up) begin_counting();
        if (is_paced) { next_tick(); drain(cycle ? cycle - 1 : 0); }
        if (cycle) lost = is_unanswered(cycle - 1) ? lost + 1 : 0;
        send_all(seqno++, cycle);
        if (is_paced) sleep_and_read(cycle);
        else wait_for_replies(cycle, clock_ns(CLOCK_MONOTONIC) + ANSWER_TIMEOUT);
    }
    return cycle;
}

/* ---- start and report ---- */

static void open_arm(int index)
{
    Arm *arm = &arms[index];
    int on = 1;
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK), .sin_port = htons((uint16_t)set.ports[index])};
    size_t cycles = (size_t)(set.warm_up + set.cycles), room = cycles * sizeof(int64_t);
    arm->socket = socket(AF_INET, SOCK_DGRAM, 0);
    setsockopt(arm->socket, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
    arm->sent = malloc(room), arm->latency = malloc(room), arm->wrong = malloc(cycles), arm->gap = -2 * RECOVERY;
    if (connect(arm->socket, (struct sockaddr *)&to, sizeof to) || !arm->sent || !arm->latency || !arm->wrong) { perror("load generator"); exit(2); }
    memset(arm->sent, 0, room), memset(arm->latency, 0, room), memset(arm->wrong, 0, cycles); /* touched now, not in a cycle */
    readable[index] = (struct pollfd){arm->socket, POLLIN, 0};
}

static void become_prompt(void)
{
    cpu_set_t cpus;
    struct sched_param parameter = {.sched_priority = set.priority};
    CPU_ZERO(&cpus);
    if (set.cpu >= 0) CPU_SET((unsigned)set.cpu, &cpus);
    if (set.cpu >= 0 && sched_setaffinity(0, sizeof cpus, &cpus)) set.cpu = -1;
    if (set.priority && sched_setscheduler(0, SCHED_FIFO, &parameter)) set.priority = 0;
    if (mlockall(MCL_CURRENT | MCL_FUTURE)) fputs("load generator: memory is not locked (not permitted)\n", stderr);
}

static void report(long cycles, int64_t duration)
{
    FILE *file = set.output ? fopen(set.output, "wb") : NULL;
    if (set.output && !file) { perror(set.output); exit(2); }
    printf("{\"cycles\": %ld, \"duration_s\": %.6f, \"generator_late_max_us\": %.1f, \"generator_cpu\": %d, \"generator_priority\": %d, \"arms\": [",
           cycles, (double)duration / 1e9, (double)latest / 1e3, set.cpu, set.priority);
    for (int i = 0; i < set.arms; ++i) {
        Arm *arm = &arms[i];
        long missed = 0;
        int64_t limit = set.is_ping_pong ? ANSWER_TIMEOUT : set.period;
        for (long c = set.warm_up; c < set.warm_up + cycles; ++c) missed += arm->latency[c] > limit || (!arm->latency[c] && !arm->wrong[c]);
        if (file) fwrite(arm->latency + set.warm_up, sizeof(int64_t), (size_t)cycles, file);
        printf("%s{\"port\": %d, \"missed\": %ld, \"stale\": %ld, \"bad\": %ld, \"recovering\": %ld, \"unparsed\": %ld, \"duplicates\": %ld}",
               i ? ", " : "", set.ports[i], missed, arm->stale, arm->bad, arm->recovering, arm->unparsed, arm->duplicates);
    }
    puts("]}");
    if (file && fclose(file)) { perror(set.output); exit(2); }
}

static void complain(long cycle)
{
    fprintf(stderr, "The server stopped answering: no right reply in %d cycles in a row, the last being %ld.", LOST_IN_A_ROW, cycle);
    for (int i = 0; i < set.arms; ++i)
        fprintf(stderr, " Port %d: %s, %ld bad, %ld recovering, %ld unparsed, %ld stale, %ld duplicates.", set.ports[i],
                arms[i].latency[cycle - 1] ? "answers" : "is silent", arms[i].bad, arms[i].recovering, arms[i].unparsed,
                arms[i].stale, arms[i].duplicates);
    fputs("\n", stderr);
}

static int read_goal(const char *text)
{
    char *rest = (char *)text;
    for (int i = 0; i < AXES; ++i, rest += *rest == ',') set.goal[i] = strtod(rest, &rest);
    return *rest == '\0';
}

static int read_options(int count, char **words)
{
    static const struct option options[] = {
        {"port", 1, 0, 'P'}, {"cycles", 1, 0, 'n'}, {"warm-up", 1, 0, 'w'}, {"period-us", 1, 0, 'p'}, {"ping-pong", 0, 0, 'b'},
        {"gain", 1, 0, 'g'}, {"goal", 1, 0, 'G'}, {"cpu", 1, 0, 'c'}, {"priority", 1, 0, 'f'}, {"output", 1, 0, 'o'},
        {"lead-in-ms", 1, 0, 'l'}, {0, 0, 0, 0}};
    for (int option; (option = getopt_long(count, words, "", options, NULL)) != -1;) switch (option) {
        case 'P': if (set.arms == MAX_ARMS) return 0; set.ports[set.arms++] = atoi(optarg); break;
        case 'n': set.cycles = atol(optarg); break;
        case 'w': set.warm_up = atol(optarg); break;
        case 'p': set.period = atol(optarg) * 1000; break;
        case 'b': set.is_ping_pong = 1; break;
        case 'g': set.gain = atof(optarg); break;
        case 'G': if (!read_goal(optarg)) return 0; break;
        case 'c': set.cpu = atoi(optarg); break;
        case 'f': set.priority = atoi(optarg); break;
        case 'o': set.output = optarg; break;
        case 'l': set.lead_in = atol(optarg) * 1000000; break;
        default: return 0;
    }
    return set.arms && set.cycles > 0 && set.warm_up >= 0 && set.cycles + set.warm_up < 1000000 && set.period > 0 && set.gain < 1;
}

int main(int count, char **words)
{
    prctl(PR_SET_PDEATHSIG, SIGKILL); /* its parent reads its figures; without it there is no purpose */
    if (!read_options(count, words)) { fputs("load generator: wrong option; its source says which there are\n", stderr); return 2; }
    signal(SIGINT, end), signal(SIGTERM, end);
    for (int i = 0; i < set.arms; ++i) open_arm(i);
    become_prompt();
    if (!lead_in()) { fputs("The server did not answer the robot as it should.\n", stderr); return 1; }
    puts("begin"), fflush(stdout);
    long moved = run_cycles(set.warm_up + set.cycles);
    int64_t duration = clock_ns(CLOCK_MONOTONIC) - counted_since;
    puts("end"), fflush(stdout);
    struct timespec rest = timespec_of(STRAGGLERS);
    nanosleep(&rest, NULL);
    if (moved) drain(moved - 1);
    if (!is_over && moved < set.warm_up + set.cycles) { complain(moved); return 1; }
    report(moved > set.warm_up ? moved - set.warm_up : 0, duration);
    return 0;
}
