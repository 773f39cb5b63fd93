#include "tools/doctor/diagnosis_output.h"

#include <nlohmann/json.hpp>

#include "heba/io/result_file.h"

namespace heba {
namespace {

const char* GradeOf(const Symptom& symptom) { return symptom.severity == Severity::kWrong ? "wrong" : "remark"; }

}  // namespace

std::string DiagnosisText(const std::string& name, const Diagnosis& diagnosis) {
  const auto num_wrong = static_cast<size_t>(diagnosis.NumWrong());
  const size_t num_remarks = diagnosis.symptoms.size() - num_wrong;
  const std::string seen = std::to_string(diagnosis.num_seen) + " of ";
  std::string text =
      name + ": " + std::to_string(diagnosis.num_captures) + " captures, " +
      (diagnosis.num_images > 0 ? seen + std::to_string(diagnosis.num_images) + " images determine a pose of a target; "
                                : seen + "them determine a pose of the target; ") +
      (num_wrong == 0 ? "nothing is wrong" : std::to_string(num_wrong) + " wrong") + ", " +
      std::to_string(num_remarks) + (num_remarks == 1 ? " remark\n" : " remarks\n");
  // Only the first of many similar symptoms are printed, with their cure once.
  constexpr size_t kMostAlike = 4;
  size_t alike = 0;
  for (size_t i = 0; i < diagnosis.symptoms.size(); ++i) {
    const Symptom& symptom = diagnosis.symptoms[i];
    const bool is_last_alike = i + 1 == diagnosis.symptoms.size() || diagnosis.symptoms[i + 1].code != symptom.code ||
                               diagnosis.symptoms[i + 1].cure != symptom.cure;
    ++alike;
    if (alike <= kMostAlike) {
      text += std::to_string(i + 1) + ". " + GradeOf(symptom) + " [" + std::string(symptom.code.name()) +
              "]: " + symptom.Text() + "\n";
    }
    if (!is_last_alike) continue;
    if (alike > kMostAlike) {
      text += "   and " + std::to_string(alike - kMostAlike) + " more [" + std::string(symptom.code.name()) +
              "] of this kind\n";
    }
    if (!symptom.cure.empty()) text += "   -> " + symptom.cure + "\n";
    alike = 0;
  }
  return text;
}

std::string DiagnosisToJson(const std::string& name, const Diagnosis& diagnosis) {
  using Json = nlohmann::ordered_json;
  Json json;
  json["schema"] = "heba/diagnosis/1";
  json["heba"] = Version();
  json["name"] = name;
  json["captures"] = diagnosis.num_captures;
  if (diagnosis.num_images > 0) json["images"] = diagnosis.num_images;
  json["seen"] = diagnosis.num_seen;
  json["wrong"] = diagnosis.NumWrong();
  json["remarks"] = static_cast<int>(diagnosis.symptoms.size()) - diagnosis.NumWrong();
  json["symptoms"] = Json::array();
  for (const Symptom& symptom : diagnosis.symptoms) {
    Json settings = Json::array();
    for (const auto& [key, value] : symptom.settings) {
      Json setting;
      setting["key"] = key;
      setting["value"] = value;
      settings.push_back(setting);
    }
    Json entry;
    entry["grade"] = GradeOf(symptom);
    entry["code"] = symptom.code.name();
    entry["text"] = symptom.Text();
    entry["action"] = symptom.cure;
    entry["settings"] = settings;
    json["symptoms"].push_back(entry);
  }
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace heba
