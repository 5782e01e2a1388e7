#include "conversions.h"
#include "publish/lcm_listener.h"

namespace imuscope::python {
namespace {

namespace py = pybind11;

struct Heard {
  std::string channel;
  std::string message;
  double age_s;
};

/// Gathers what comes while Python's lock is free.
class Listener {
 public:
  Listener(const std::string& url, const std::string& prefix) : bus_(take(LcmListener::open(url, prefix))) {}

  void subscribe(const std::string& kind) {
    take(bus_.subscribe(kind, [this](const std::string& channel, std::span<const std::uint8_t> message) {
      heard_.push_back({channel,
                        {reinterpret_cast<const char*>(message.data()), message.size()},
                        std::chrono::duration<double>(bus_.age()).count()});
    }));
  }

  py::list wait(int timeout_ms) {
    {
      const py::gil_scoped_release unlocked;
      bus_.wait(std::chrono::milliseconds(timeout_ms));
    }
    py::list out;
    for (const Heard& heard : heard_)
      out.append(py::make_tuple(heard.channel, py::bytes(heard.message), heard.age_s));
    heard_.clear();
    return out;
  }

 private:
  LcmListener bus_;
  std::vector<Heard> heard_;
};

}  // namespace

void bind_live(py::module_& module) {
  module.attr("default_lcm_url") = std::string(kDefaultLcmUrl);
  py::class_<Listener>(module, "Listener")
      .def(py::init<const std::string&, const std::string&>())
      .def("subscribe", &Listener::subscribe)
      .def("wait", &Listener::wait);
}

}  // namespace imuscope::python
