// The parts of the extension module, each in one file.
#pragma once

#include <pybind11/pybind11.h>

namespace heba {

void BindPosePairs(pybind11::module_& module);  // Hand-eye poses from pairs of poses.
void BindCaptures(pybind11::module_& module);   // Detection, and calibration from detected points.
void BindRuns(pybind11::module_& module);       // Runs of configs, and the doctor.
void BindResults(pybind11::module_& module);    // Finished results give tables, exports, comparisons and true poses.
void BindSheets(pybind11::module_& module);     // Sheets of targets are printed.
void BindLocations(pybind11::module_& module);  // Location of targets with the result of a run.
void BindSessions(pybind11::module_& module);   // Recorded, simulated, planned and checked sessions.
void BindStudies(pybind11::module_& module);    // Studies of simulated trials.

}  // namespace heba
