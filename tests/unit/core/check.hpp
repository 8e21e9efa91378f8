// Tests of the core in C++: `TEST(sentence) { CHECK(...); }`; `main` runs all of a file.

#pragma once

#include <cstdio>
#include <vector>

struct Test {
    const char* name;
    void (*run)();
};
inline std::vector<Test> tests;
inline int failures = 0;

struct Registered {
    Registered(const char* name, void (*run)()) { tests.push_back({name, run}); }
};

#define TEST(name)                                      \
    static void name();                                 \
    static const Registered registered_##name(#name, name); \
    static void name()

#define CHECK(condition)                                                            \
    do {                                                                            \
        if (!(condition)) {                                                         \
            ++failures;                                                             \
            std::printf("%s:%d: %s\n", __FILE__, __LINE__, #condition);             \
        }                                                                           \
    } while (false)

int main() {
    for (const Test& test : tests) {
        const int before = failures;
        test.run();
        std::printf("%s %s\n", failures == before ? "passed" : "FAILED", test.name);
    }
    return failures != 0;
}
