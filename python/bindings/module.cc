// The extension module heba._heba. The package heba checks arguments and documents the functions; this module converts
// them. No function holds the GIL while it computes.
#include "python/bindings/bindings.h"

#include <string>
#include <vector>

#include <glog/logging.h>
#include <pybind11/stl.h>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/io/result_file.h"

PYBIND11_MODULE(_heba, module) {
  module.doc() = "The compiled part of heba.";
  FLAGS_logtostderr = true;
  FLAGS_minloglevel = google::GLOG_ERROR;
  // heba.Error is a ValueError, as OpenCV's users and numpy's expect of wrong arguments.
  pybind11::register_exception<heba::InputError>(module, "Error", PyExc_ValueError);
  module.attr("__version__") = heba::Version();
  module.def("unknown_name", [](const std::string& unknown, const std::vector<std::string>& known) {
    return heba::UnknownName(unknown, known);
  });
  heba::BindPosePairs(module);
  heba::BindCaptures(module);
  heba::BindRuns(module);
  heba::BindResults(module);
  heba::BindSheets(module);
  heba::BindLocations(module);
  heba::BindSessions(module);
  heba::BindStudies(module);
}
