/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/hold.h"

#include "lab/numeric/least_squares.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { columns = 5 };

/// Mean of a signal from row n - width to row n, its ends counted half.
static double mean_over(const double *sums, const double *x, size_t n, size_t width)
{
    double sum = sums[n + 1] - sums[n - width] - 0.5 * (x[n] + x[n - width]);
    return sum / (double)width;
}

/// Running sums from the first row on, rows + 1 of them.
static void sum_up(size_t rows, const double *x, double *out_sums)
{
    out_sums[0] = 0.0;
    for (size_t n = 0; n < rows; n++)
        out_sums[n + 1] = out_sums[n] + x[n];
}

/// Fills in the regression's columns (rows x columns) and what they have to explain.
static void fill(const struct recording *r, size_t width, double *sums, double *A, double *out_torque)
{
    const struct stretch *b = &r->block;
    size_t all = b->samples, rows = all - width;
    double *torque = sums, *velocity = torque + all + 1, *sign = velocity + all + 1, *direction = sign + all + 1;
    for (size_t n = 0; n < all; n++)
        direction[n] = (double)(b->velocity[n] > 0.0) - (double)(b->velocity[n] < 0.0);
    sum_up(all, b->torque, torque);
    sum_up(all, b->velocity, velocity);
    sum_up(all, direction, sign);
    for (size_t i = 0; i < rows; i++) {
        size_t n = i + width;
        out_torque[i] = mean_over(torque, b->torque, n, width);
        A[i] = (b->velocity[n] - b->velocity[n - width]) / (double)width;
        A[rows + i] = mean_over(velocity, b->velocity, n, width);
        A[2 * rows + i] = mean_over(sign, direction, n, width);
        A[3 * rows + i] = 1.0;
        A[4 * rows + i] = (b->torque[n] - b->torque[n - width]) / (double)width;
    }
}

static double power_about_mean(size_t rows, const double *x)
{
    double mean = 0.0, sum = 0.0;
    for (size_t i = 0; i < rows; i++)
        mean += x[i] / (double)rows;
    for (size_t i = 0; i < rows; i++)
        sum += (x[i] - mean) * (x[i] - mean);
    return sum;
}

/// Solves and says how much of the torque is left.
static bool solve(size_t rows, const double *A, const double *torque, struct hold *out_hold)
{
    const double none[columns] = {0.0};
    double x[columns], covariance[columns * columns], rest = 0.0, power = power_about_mean(rows, torque);
    if (!(power > 0.0) || !least_squares_solve(rows, columns, A, torque, none, none, x, covariance))
        return false;
    for (size_t i = 0; i < rows; i++) {
        double left = torque[i];
        for (size_t j = 0; j < columns; j++)
            left -= A[j * rows + i] * x[j];
        rest += left * left;
    }
    out_hold->delay = x[columns - 1];
    out_hold->deviation = sqrt(covariance[columns * columns - 1] * rest / (double)rows);
    out_hold->explained = 1.0 - rest / power;
    return true;
}

bool hold_find(const struct recording *recording, struct hold *out_hold)
{
    size_t all = recording->block.samples, highest = recording->bins[recording->bin_count - 1];
    size_t width = all / (8 * highest);
    width = width < 1 ? 1 : width;
    size_t rows = all - width;
    double *work = malloc((4 * (all + 1) + rows * (columns + 1)) * sizeof *work);
    if (!work || rows < 4 * columns) {
        free(work);
        return false;
    }
    double *A = work + 4 * (all + 1), *torque = A + rows * columns;
    fill(recording, width, work, A, torque);
    bool good = solve(rows, A, torque, out_hold);
    free(work);
    return good;
}
