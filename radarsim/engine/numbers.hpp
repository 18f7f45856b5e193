// Numbers as Python treats them, and arrays.
#pragma once
#include <math.h> // and no header of C++: its library takes minutes to build
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

namespace radarsim {

using Triangle = double[9]; // m, x, y, z of each corner in turn
using Vector = double[3];

constexpr double INFINITE = __builtin_inf(), NOT_A_NUMBER = __builtin_nan("");

// Python's min and max: of equal numbers, and of numbers that are none, the first.
inline double least(double a, double b) { return b < a ? b : a; }
inline double most(double a, double b) { return b > a ? b : a; }
inline double least(double a, double b, double c) { return least(least(a, b), c); }
inline double most(double a, double b, double c) { return most(most(a, b), c); }

// The whole part of a number; the least of all integers where there is none.
inline int64_t whole_of(double number) { return fabs(number) < 0x1p63 ? int64_t(number) : INT64_MIN; }

// An array that numpy owns; T may be a row, as Vector is.
template <typename T, int D = 1> struct Array {
    T* data;
    int64_t shape[D];

    int64_t size() const { return shape[0]; }
    T& operator[](int64_t i) const { return data[i]; }
    T& operator()(int64_t i, int64_t j) const { return data[i * shape[1] + j]; }
    T& operator()(int64_t i, int64_t j, int64_t k) const { return data[(i * shape[1] + j) * shape[2] + k]; }
    T* row(int64_t i) const { return data + i * shape[1]; } // of a table
    T* begin() const { return data; }
    T* end() const { return data + size(); }
};

// Zeros, for as long as the object exists.
template <typename T> class Room {
  public:
    explicit Room(int64_t size) : data_(static_cast<T*>(calloc(size + 1, sizeof(T)))) {
        if (!data_) abort(); // without memory for a few kilobytes
    }
    ~Room() { free(data_); }
    Room(const Room&) = delete;
    Room& operator=(const Room&) = delete;
    T* data() const { return data_; }
    T& operator[](int64_t i) const { return data_[i]; }

  private:
    T* data_;
};

// A list of a limited length.
template <typename T> class List {
  public:
    explicit List(int64_t capacity) : room_(capacity) {}
    int64_t size() const { return size_; }
    T& operator[](int64_t i) const { return room_[i]; }
    T* begin() const { return room_.data(); }
    T* end() const { return room_.data() + size_; }
    void append(T value) { room_[size_++] = value; }
    void clear() { shorten(0); }
    void shorten(int64_t size) { size_ = size; }
    // Remove a value if it is in the list; those behind it move up.
    void remove(T value) {
        int64_t i = 0;
        while (i < size_ && room_[i] != value) i++;
        if (i == size_) return;
        for (size_--; i < size_; i++) room_[i] = room_[i + 1];
    }

  private:
    Room<T> room_;
    int64_t size_ = 0;
};

} // namespace radarsim
