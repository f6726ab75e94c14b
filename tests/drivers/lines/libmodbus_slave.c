/* A Modbus RTU slave by libmodbus, for the driver to talk to: holding registers 0000 to 00FF hex,
 * of which 00CC/00CD say 8500. Arguments: port, unit. Ends when the port does or on a write to
 * 00FF hex. */
#include <modbus.h>
#include <stdlib.h>

int main(int count, char **argument)
{
    uint8_t query[MODBUS_RTU_MAX_ADU_LENGTH];
    modbus_mapping_t *registers = modbus_mapping_new(0, 0, 256, 0);
    modbus_t *line = count == 3 ? modbus_new_rtu(argument[1], 115200, 'N', 8, 1) : NULL;
    int length;

    if (!line || !registers || modbus_set_slave(line, atoi(argument[2])) || modbus_connect(line))
        return 1;
    registers->tab_registers[0xCD] = 8500;
    while (registers->tab_registers[0xFF] == 0) {
        length = modbus_receive(line, query);
        if (length < 0)
            break;
        if (length > 0 && modbus_reply(line, query, length, registers) < 0)
            break;
    }
    modbus_close(line);
    modbus_free(line);
    modbus_mapping_free(registers);
    return 0;
}
