// Datagrams are read whole or refused, whatever is in them.

#include <cstring>
#include <random>

#include "check.hpp"
#include "egm_codec.hpp"
#include "robot.hpp"

namespace {

using Bytes = std::vector<unsigned char>;

Bytes field(int number, const Bytes& inside) {
    Bytes bytes = {static_cast<unsigned char>(number << 3 | 2), static_cast<unsigned char>(inside.size())};
    bytes.insert(bytes.end(), inside.begin(), inside.end());
    return bytes;
}
Bytes operator+(Bytes a, const Bytes& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}
Bytes number(double value) {
    Bytes bytes(9, 0x09);
    std::memcpy(&bytes[1], &value, 8);
    return bytes;
}

// A robot's message, with all joints at these degrees.
Bytes datagram(double degrees) {
    Bytes axes;
    for (int i = 0; i < 6; ++i) axes = axes + number(degrees);
    const Bytes motion = field(1, axes) + field(3, number(degrees)) + field(4, {0x08, 10, 0x10, 20});
    return field(1, {0x08, 5, 0x18, 2}) + field(2, motion) + field(3, motion) + field(4, {0x08, 1}) +
           field(5, {0x08, 3}) + field(8, {0x08, 2});
}

bool reads(const Bytes& bytes, core::JointReport& report) {
    // Of its own size, so that a sanitizer sees what is read behind it.
    const Bytes own(bytes.begin(), bytes.end());
    core::Unreadable unreadable;
    return core::JointCodec::decode(own.data(), own.size(), report, unreadable);
}

}  // namespace

TEST(message_is_read) {
    core::JointReport report;
    CHECK(reads(datagram(90.0), report));
    CHECK(report.seqno == 5 && report.motors == 1 && report.mci == 3 && report.rapid == 2);
    CHECK(std::abs(report.time - 10.00002) < 1e-12);
    for (double each : report.measured) CHECK(std::abs(each - M_PI / 2.0) < 1e-12);
}

TEST(message_that_was_cut_anywhere_is_refused) {
    const Bytes whole = datagram(90.0);
    core::JointReport report;
    for (std::size_t size = 0; size < whole.size(); ++size)
        CHECK(!reads(Bytes(whole.begin(), whole.begin() + std::ptrdiff_t(size)), report));
}

TEST(message_with_anything_changed_is_read_with_possible_joints_or_refused) {
    std::mt19937 random(3);
    auto below = [&](std::size_t most) { return std::size_t(random() % most); };
    int read = 0;
    for (int run = 0; run < 200'000; ++run) {
        Bytes bytes = datagram(double(below(360)));
        for (std::size_t change = below(4); change > 0; --change) {
            const auto at = bytes.begin() + std::ptrdiff_t(below(bytes.size()));
            switch (below(4)) {
                case 0: *at = static_cast<unsigned char>(below(256)); break;
                case 1: *at ^= static_cast<unsigned char>(1 << below(8)); break;
                case 2: bytes.insert(at, static_cast<unsigned char>(below(256))); break;
                default: bytes.erase(at, at + std::min<std::ptrdiff_t>(5, bytes.end() - at));
            }
            if (bytes.empty()) bytes.push_back(0);
        }
        core::JointReport report;
        if (!reads(bytes, report)) continue;
        ++read;
        CHECK(core::largest(report.measured) < 1100.0 * M_PI / 180.0);
        CHECK(core::largest(report.planned) < 1100.0 * M_PI / 180.0);
    }
    CHECK(read > 10'000);
}

TEST(groups_in_groups_do_not_exhaust_the_stack) {
    core::JointReport report;
    CHECK(!reads(datagram(90.0) + Bytes(900 - datagram(90.0).size(), 0x0B), report));
}

TEST(reference_that_is_not_finite_is_not_written) {
    unsigned char bytes[core::LARGEST_REFERENCE];
    core::ArmCommand command;
    CHECK(core::JointCodec::encode(0xFFFFFFFF, command, bytes) == 2 + 8 + 69);
    command.has_velocity = 1;
    CHECK(core::JointCodec::encode(0xFFFFFFFF, command, bytes) == 2 + 8 + 2 * 69);
    command.velocity[3] = NAN;
    CHECK(core::JointCodec::encode(0, command, bytes) == 0);
}
