// SPDX-License-Identifier: Apache-2.0
// Proves: /api/openapi.json describes the addresses that there are, and what they answer.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>

#include "tests/unit/web/gateway_fixture.h"
#include "web/gateway/routes.h"

namespace relievo::test {
namespace {

using Json = nlohmann::json;

class OpenApi : public GatewayTest {
 protected:
  void SetUp() override {
    GatewayTest::SetUp();
    document = Json::parse(request(port, "GET", "/api/openapi.json").body);
  }
  /// What a $ref stands for, or the value itself.
  const Json& resolved(const Json& value) const {
    if (!value.is_object() || !value.contains("$ref")) return value;
    return document.at(Json::json_pointer(value["$ref"].get<std::string>().substr(1)));
  }
  void expect_resolvable(const Json& value) const {
    if (value.is_object() && value.contains("$ref")) {
      EXPECT_NO_THROW((void)resolved(value)) << value;
    }
    for (const auto& inner : value) {
      if (inner.is_structured()) expect_resolvable(inner);
    }
  }
  /// `value` has what the schema requires, nothing that it does not name, each of its type.
  void expect_fits(const Json& value, const Json& schema_or_ref, const std::string& where) const {
    const Json& schema = resolved(schema_or_ref);
    const std::string kind = value.is_number_integer() ? "integer" : value.type_name();
    if (schema.contains("type")) {
      const Json types = schema["type"].is_array() ? schema["type"] : Json::array({schema["type"]});
      const bool fits = std::find(types.begin(), types.end(), kind) != types.end() ||
                        (kind == "integer" && std::find(types.begin(), types.end(), "number") != types.end());
      EXPECT_TRUE(fits) << where << " is " << kind << ", not " << types;
    }
    if (schema.contains("enum")) {
      EXPECT_NE(std::find(schema["enum"].begin(), schema["enum"].end(), value), schema["enum"].end())
          << where;
    }
    for (const auto& name : schema.value("required", Json::array()))
      EXPECT_TRUE(value.contains(name.get<std::string>())) << where << " lacks " << name;
    if (schema.contains("properties")) {
      for (const auto& [name, inner] : value.items()) {
        ASSERT_TRUE(schema["properties"].contains(name)) << where << '.' << name << " is not described";
        expect_fits(inner, schema["properties"][name], where + '.' + name);
      }
    }
    if (schema.contains("items"))
      for (const auto& inner : value) expect_fits(inner, schema["items"], where + "[]");
  }

  Json document;
};

TEST_F(OpenApi, DescribesTheAddressesThereAre) {
  EXPECT_EQ(document["openapi"], "3.1.0");
  std::set<std::string> described, known;
  for (const auto& [path, item] : document["paths"].items()) described.insert(path);
  for (const std::string_view path : route_paths()) known.emplace(path);
  EXPECT_EQ(described, known);
  expect_resolvable(document);
}

TEST_F(OpenApi, EveryAddressAnswersAsDescribed) {
  for (const bool live : {false, true}) {
    if (live) gateway->announce(make_info());
    for (const auto& [path, item] : document["paths"].items()) {
      std::string target = path;
      std::size_t parameter = 0;
      for (auto brace = target.find('{'); brace != std::string::npos; brace = target.find('{')) {
        const auto end = target.find('}', brace);
        EXPECT_EQ(resolved(item["get"]["parameters"][parameter++])["name"],
                  target.substr(brace + 1, end - brace - 1));
        target.replace(brace, end + 1 - brace, "face");
      }
      const auto response = request(port, "GET", target);
      const auto& responses = item["get"]["responses"];
      const std::string status = std::to_string(response.status);
      ASSERT_TRUE(responses.contains(status)) << path << " answered " << status;
      const Json& described = resolved(responses[status]);
      EXPECT_FALSE(described["description"].get<std::string>().empty());
      const std::string type = response.headers.at("content-type");
      EXPECT_TRUE(described["content"].contains(type.substr(0, type.find(';')))) << path << ' ' << type;
      // What any address may answer, as to more than one host's name.
      const auto refused = request(port, "GET", target, "Host: other.example\r\n");
      EXPECT_EQ(refused.status, 400) << path;
      EXPECT_TRUE(responses.contains("400") || responses.contains("default")) << path;
      EXPECT_TRUE(refused.headers.at("content-type").starts_with("text/plain")) << path;
    }
  }
}

TEST_F(OpenApi, StreamsAreAsDescribed) {
  gateway->announce(make_info("one"));
  gateway->announce(make_info("two"));
  ServerStatus status;
  status.stream = "two";
  gateway->publish(status);
  const auto streams = Json::parse(request(port, "GET", "/api/streams").body);
  ASSERT_EQ(streams["streams"].size(), 2u);
  const auto& responses = document["paths"]["/api/streams"]["get"]["responses"];
  expect_fits(streams, responses["200"]["content"]["application/json"]["schema"], "streams");
}

TEST_F(OpenApi, ReadyIsWhoHasAStream) {
  EXPECT_EQ(request(port, "GET", "/readyz").status, 503);
  gateway->announce(make_info());
  EXPECT_EQ(request(port, "GET", "/readyz").body, "ready: 1 stream\n");
  gateway->withdraw("face");
  EXPECT_EQ(request(port, "GET", "/readyz").status, 503);
}

}  // namespace
}  // namespace relievo::test
